"""Frequency responses in many digits, sharing no line with the package: Cartesian rows, whole matrices, mpmath.

Coordinates are x (on a cart) and all angles; M = Σ m h hᵀ + I e eᵀ with the displacement h of a link's centre, V and
the dissipation likewise; D of damping ratios from the eigenvectors of the pencil.  Every number of the scene is its
float, and a rod's inertia m l²/12 exactly.
"""

from __future__ import annotations

import mpmath as mp

from modal.scene import Cart, Rod, Scene

INPUTS = ("cart_force", "joint_torques", "link_forces")
DRIVEN = ("cart_acceleration", "cart_velocity", "support_displacement", "support_velocity", "support_acceleration")


class Oracle:
    """G of every input and output by name, with the matrices of a scene in `digits` digits."""

    def __init__(self, scene: Scene, digits: int = 90) -> None:
        self.digits, self.scene = digits, scene
        with mp.workdps(digits):
            self._assemble(scene)

    def _assemble(self, scene: Scene) -> None:
        self.cart = isinstance(scene.support, Cart)
        hung = [pendulum for pendulum in scene.pendulum for _ in range(pendulum.count)]
        runs = [[link for link in pendulum.links for _ in range(link.count)] for pendulum in hung]
        n = sum(map(len, runs)) + self.cart
        self.n = n
        self.M, self.K, self.D = (mp.zeros(n) for _ in range(3))
        self.rows: dict[str, list[mp.mpf]] = {}
        self.mass: dict[int, list[tuple[mp.mpf, mp.mpf, list[mp.mpf]]]] = {}
        self.torque: dict[str, list[mp.mpf]] = {}
        self.force: dict[str, tuple[int, list[mp.mpf]]] = {}
        g, at = mp.mpf(scene.gravity), int(self.cart)
        carried = [mp.mpf(1 if self.cart and j == 0 else 0) for j in range(n)]
        if self.cart:
            self.M[0, 0] += scene.support.mass
            self.K[0, 0] += scene.support.stiffness
            self.D[0, 0] += scene.support.damping
            self.rows["x"] = carried
        for p, (pendulum, links) in enumerate(zip(hung, runs, strict=True), 1):
            ways = [1 if way == "down" else -1 for way in pendulum.equilibrium or ["down"] * len(links)]
            joint, self.mass[p] = list(carried), []
            for i, (link, way) in enumerate(zip(links, ways, strict=True), 1):
                m, l = mp.mpf(link.mass), mp.mpf(link.length)
                c, inertia = (
                    (l / 2, m * l * l / 12) if isinstance(link, Rod) else map(mp.mpf, (link.centre, link.inertia))
                )
                centre, angle, bend = list(joint), [mp.mpf(0)] * n, [mp.mpf(0)] * n
                centre[at] += way * c
                joint[at] += way * l
                angle[at], bend[at] = mp.mpf(1), mp.mpf(1)
                if i > 1:
                    bend[at - 1] = mp.mpf(-1)
                for a in range(n):
                    for b in range(n):
                        self.M[a, b] += m * centre[a] * centre[b] + inertia * angle[a] * angle[b]
                        self.M[a, b] += mp.mpf(link.rotor_inertia) * link.gear_ratio**2 * bend[a] * bend[b]
                        self.K[a, b] += link.stiffness * bend[a] * bend[b]
                        self.D[a, b] += link.damping * bend[a] * bend[b] + link.drag * centre[a] * centre[b]
                for above in range(int(self.cart), n):  # the weight of this link turns every link above it
                    self.K[above, above] += m * g * abs(centre[above]) * (1 if centre[above] > 0 else -1)
                name = f"{p}_{i}"
                self.rows |= {f"theta_{name}": angle, f"rel_{name}": bend, f"joint_{name}": list(joint)}
                self.mass[p].append((m, mp.mpf(link.drag), centre))
                self.torque[f"torque_{name}"], self.force[f"force_{name}"] = bend, (p, centre)
                at += 1
            self.rows[f"tip_{p}"] = list(joint)
        self.modal = scene.has_modal_damping

    def _ratio_dampers(self, first: int) -> mp.matrix:
        """D_modal of the coordinates from `first` on: 2 ζ ω (Mφ)(Mφ)ᵀ of every undamped mode."""
        M, K = self.M[first:, first:], self.K[first:, first:]
        L = mp.cholesky(M)
        inverse = L**-1
        square, V = mp.eigsy(inverse * K * inverse.T)
        dampers, ratios, number = mp.zeros(self.n), self.scene.damping_ratio, -1
        small, last = mp.mpf(10) ** (-self.digits // 2) * max(square), -max(square)
        for k in range(len(square)):
            number += square[k] - last > mp.mpf(10) ** -12 * max(abs(square[k]), small)
            last = square[k]
            each = (*ratios, *[0] * self.n) if isinstance(ratios, tuple) else [ratios] * (self.n + 1)
            ratio = mp.mpf(each[number])
            if square[k] > small:
                momentum = L * V[:, k]
                for a in range(len(momentum)):
                    for b in range(len(momentum)):
                        dampers[a + first, b + first] += 2 * ratio * mp.sqrt(square[k]) * momentum[a] * momentum[b]
        return dampers

    def response(self, inputs: list[str], outputs: list[str], omega: float) -> mp.matrix:
        """G (outputs, inputs) at ω in rad/s, by the names of signals."""
        with mp.workdps(self.digits):
            return self._response(inputs, outputs, mp.mpf(omega))

    def _response(self, inputs: list[str], outputs: list[str], w: mp.mpf) -> mp.matrix:
        held = any(name in ("cart_acceleration", "cart_velocity") for name in inputs)
        first = int(held)
        D = self.D + self._ratio_dampers(first) if self.modal else self.D
        A = self.K + mp.mpc(0, 1) * w * D - w * w * self.M
        F, q0, ground = mp.zeros(self.n, len(inputs)), [0] * len(inputs), [0] * len(inputs)
        for k, name in enumerate(inputs):
            if name in self.torque:
                F[:, k] = mp.matrix(self.torque[name])
            elif name in self.force:
                F[:, k] = mp.matrix(self.force[name][1])
            elif name == "cart_force":
                F[0, k] = 1
            elif name.startswith("cart"):
                q0[k] = 1 / (mp.mpc(0, 1) * w) ** (2 if "acc" in name else 1)
            else:
                order = ["displacement", "velocity", "acceleration"].index(name.removeprefix("support_"))
                ground[k] = 1 / (mp.mpc(0, 1) * w) ** order
                for j in range(self.n):  # the momentum of everything at unit velocity
                    cart_mass = self.scene.support.mass if self.cart and j == 0 else 0
                    F[j, k] = (
                        w
                        * w
                        * ground[k]
                        * (cart_mass + sum(m * h[j] for links in self.mass.values() for m, _, h in links))
                    )
        q = mp.zeros(self.n, len(inputs))
        right = F[first:, :] - (A[first:, 0] * mp.matrix([q0]) if held else 0 * F[first:, :])
        solved = mp.lu_solve(A[first:, first:], right) if len(inputs) == 1 else A[first:, first:] ** -1 * right
        q[first:, :] = solved
        if held:
            q[0, :] = mp.matrix([q0])
        response = mp.zeros(len(outputs), len(inputs))
        for r, name in enumerate(outputs):
            order = 1 if "_dot" in name and "ddot" not in name else 2 if "ddot" in name else 0
            base = name.replace("_ddot", "").replace("_dot", "")
            for k, input_name in enumerate(inputs):
                turn = (mp.mpc(0, 1) * w) ** order
                if not base.startswith("pivot"):
                    row = self.rows[base]
                    moved = sum(row[j] * q[j, k] for j in range(self.n))
                    carried = ground[k] if base[0] in "xjt" and not base.startswith("theta") else 0
                    response[r, k] = turn * (moved + carried)
                    continue
                p = int(base.split("_")[-1])
                for m, drag, h in self.mass[p]:
                    moved = sum(h[j] * q[j, k] for j in range(self.n)) + ground[k]
                    response[r, k] += w * w * m * moved - mp.mpc(0, 1) * w * drag * moved
                if input_name in self.force and self.force[input_name][0] == p:
                    response[r, k] += 1
        return response
