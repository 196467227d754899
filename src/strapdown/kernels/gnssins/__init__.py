"""The low-cost GNSS/INS of thesis E: its blocks, one module each, and the step that joins them."""
