"""The smoother's backward pass against Rauch, Tung and Striebel with dense matrices."""

import numpy as np

from strapdown.kernels.ins import covariance, smooth
from strapdown.kernels.ins import layout as k
from strapdown.navigation import LooselyCoupled

FLT = LooselyCoupled(states=("fix_error",))
P_VEC = FLT._params()
N, M = int(P_VEC[k.N]), int(P_VEC[k.M])


def test_adjoint_pass_agrees_with_dense_smoothing_of_random_steps():
    rng = np.random.default_rng(4)
    steps = 6
    A = rng.standard_normal((N, N))
    P = A @ A.T / N + np.eye(N)
    x = np.zeros(N)  # filter estimate, never fed back: the adjoint does not care
    w = np.zeros(k.TAPE + 200_000)
    w[k.RECORD] = 1.0
    w[k.NEXT] = k.TAPE
    i_bp = int(P_VEC[k.I_BP])
    history = []
    for _ in range(steps):
        F = 0.3 * rng.standard_normal((9, M)) * (rng.random((9, M)) < 0.4)
        fade = 0.8, 0.5, 0.3, 0.2  # of b_p and b_r, of b_v, of b_r and b_v into b_p
        Phi = np.eye(N)
        Phi[:9, :M] += F
        Phi[i_bp : i_bp + 6] *= fade[0]
        Phi[i_bp + 6 : i_bp + 9] *= fade[1]
        Phi[range(i_bp, i_bp + 3), range(i_bp + 3, i_bp + 6)] = fade[2]
        Phi[range(i_bp, i_bp + 3), range(i_bp + 6, i_bp + 9)] = fade[3]
        at = int(w[k.NEXT])
        size = 6 + 9 * M
        w[at], w[at + 1 : at + 5], w[at + size - 1] = k.R_PREDICT, fade, size
        w[at + 5 : at + 5 + 9 * M] = F.ravel()
        w[k.NEXT] = at + size
        Q = np.diag(rng.uniform(0.01, 0.1, N))
        x_before, P_before = Phi @ x, Phi @ P @ Phi.T + Q
        x, P = x_before.copy(), P_before.copy()
        for _ in range(3):
            h = rng.standard_normal(N) * (rng.random(N) < 0.3)
            h[int(rng.integers(N))] = 1.0
            y = float(rng.standard_normal() - h @ x)
            w[k.H : k.H + N] = h
            w[k.DX : k.DX + N] = 0.0
            covariance.project(P, P_VEC, w)
            covariance.absorb(P, P_VEC, w, y, 0.5)
            x = x + w[k.DX : k.DX + N]
        memory = FLT._memory()[0]
        smooth.mark(memory, P, P_VEC, w, len(history))
        history.append((Phi, x_before, P_before, x.copy(), P.copy()))

    # truth: Rauch-Tung-Striebel
    xs, Ps = history[-1][3], history[-1][4]
    want = [(xs, Ps)]
    for j in range(steps - 2, -1, -1):
        Phi, x_before, P_before = history[j + 1][:3]
        C = history[j][4] @ Phi.T @ np.linalg.inv(P_before)
        xs = history[j][3] + C @ (xs - x_before)
        Ps = history[j][4] + C @ (Ps - P_before) @ C.T
        want.insert(0, (xs, Ps))

    lam, Lam = np.zeros(N), np.zeros((N, N))
    at = int(w[k.NEXT])
    j = steps - 1
    while at > k.TAPE:
        at -= int(w[at - 1])
        kind = int(w[at])
        if kind == k.R_MARK:
            smooth._smoothed_here(P_VEC, w, at, lam, Lam)
            correction = want[j][0] - history[j][3]
            np.testing.assert_allclose(w[k.DX : k.DX + N], correction, atol=1e-9)
            np.testing.assert_allclose(w[k.H : k.H + 15], np.diag(want[j][1])[:15], atol=1e-9)
            j -= 1
        elif kind == k.R_SCALAR:
            smooth._back_over_scalar(P_VEC, w, at, lam, Lam)
        elif kind == k.R_PREDICT:
            smooth._back_over_prediction(P_VEC, w, at, lam, Lam)
    assert j == -1
    np.testing.assert_allclose(Lam, Lam.T, atol=1e-12)
