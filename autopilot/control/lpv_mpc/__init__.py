"""The control law of profile flight: position, attitude and rotors in one LPV-MPC.

The thesis's first strategy [3.1, 3.4] with another schedule: at the present state alone its model cannot tilt
(`thesis.global_mpc`); here it is scheduled along the plan. Numbers in brackets are the thesis's equations.

**State** (`model`, `deviations`). The nominal motion x̄ has position and velocity, ENU, quaternion, and body rates,
FLU. The MPC predicts its deviation, 12:

    δx = [position; velocity; rotation vector, body axes; body rates]

Squared rotor speeds s, in parts of the largest, follow their commands u with the rotors' lag τ: ds/dt = (u - s) / τ.

**Input** (`feed_forward`, `planning`). u = ū + c: the references' commands ū by differential flatness, plus a
correction c that is constant over a block of steps. The thesis decides increments of the input [3.13-3.22]; here z are
changes of c from the previous plan.

**LPV model** (`deviations`). The equations of motion [2.8] with drag, rotor lag and observed disturbances. A
Runge-Kutta rollout with the previous plan's corrections gives x̄. The Jacobians in the middle of each step give the
matrices, by a Taylor series to the third power of the step:

    δx[n+1] = A(x̄[n]) δx[n] + B(x̄[n]) δs[n]

**Condensing** [3.20] (`cost`). Elimination of the states leaves δx[n] = X[n] z. With the error e[n] of the
nominal motion:

    min ½ zᵀ H z + fᵀ z
    H = Σ X[n]ᵀ Q X[n] + X[N]ᵀ S X[N] + R,   f = Σ X[n]ᵀ Q e[n] + X[N]ᵀ S e[N] + r

**Cost** [3.13-3.20] (`cost`). Q weighs position, velocity, heading and rates at every counted step; for a demanded
attitude tilt and thrust in their stead. R and r weigh changes of c from the previous plan and from block to block. S is
the cost of the LQR that flies on after the horizon.

**Constraints** (`constraints`), which the thesis leaves out. Rotor limits are bounds on z, so the QP is always
feasible. Tilt and rates are soft rows with a slack each, in a second QP, solved only if the first plan exceeds them.

**QP** (`planning`, `mpc`). The unconstrained minimum by Cholesky is the solution if all bounds hold; otherwise the
profile's solver finds it.

**Warm start.** The nominal motion continues the previous plan, so z is small, and one QP per sample suffices. Without a
solution the previous plan flies on for some samples, then the recovery (`parts.recovery`).

**Path speed** (`path`). Optionally the speed along the references at the end of each block is a variable, too.
"""
