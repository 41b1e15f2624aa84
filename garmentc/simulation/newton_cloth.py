"""One piece of cloth and one moving body in Newton's Style3D solver, on the CPU.

Newton (https://github.com/newton-physics/newton) 1.8; the solver is projective dynamics with contact between cloth and
body and of the cloth with itself. What the API doesn't say, and this file does for you:

- Rest shapes are two-dimensional panels. Left out, the solver takes the XY projection of the mesh and the cloth
  explodes: each triangle is laid flat on its own here.
- The collider's bounding box is fixed when the model is built; contacts outside it are dropped. It is widened.
- A deforming collider drags cloth along only if the velocities of its vertices are set.
- `numpy()` of a CPU array is a view of memory that the next step overwrites: positions are copied.
- Bending stiffness is looked up by the direction of an edge in its panel, which means nothing where each triangle is a
  panel: it is set alike for all edges.
- A pinned particle of mass zero makes the self-collision divide zero by zero. Pins are heavy particles instead, thrown
  so that they land where they belong.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.fabrics import Fabric
from garmentc.simulation.native_stderr import native_stderr_closed
from garmentc.simulation.simulation_settings import SimulationSettings

_GRAVITY = -9.81
_REACH = 1e3
"""Metres: half the size of the collider's bounding box."""
_PIN_MASS = 10.0
"""Kilograms: nothing that hangs on a pin moves it by more than 0.1 mm."""
_BENDING_EXCESS = 3.0
"""A sheet rolled to a cylinder has this many times the energy in the solver that it has by plate theory: exactly so for
equilateral triangles and for grids along the cylinder, whose hinges each count with three over their area."""
_VELOCITY_KEPT = np.float32(0.998)
"""Share of its velocity that the solver leaves to each vertex in a step."""
_STEPS_PER_REBUILD = 20
"""Bounding-volume hierarchies are refitted each step and built anew this often."""


class NewtonCloth:
    """The state of a simulation: `positions` changes with each `advance`.

    The authored mesh `vertices` (N, 3) is the unstretched shape; flat is the unbent one. The body (V, 3), (F, 3) is
    where it is at the start. `pinned` (P,) are the vertices that `advance` moves by hand. Y is up, metres.
    """

    def __init__(
        self,
        vertices: NDArray[Any],
        triangles: NDArray[Any],
        fabric: Fabric,
        body: NDArray[Any],
        faces: NDArray[Any],
        pinned: NDArray[np.intp],
        settings: SimulationSettings,
    ) -> None:
        newton, wp = import_newton()
        self._settings = settings
        self._pinned = pinned
        self._body = np.array(body, dtype=np.float32)
        soft = min(1.0, fabric.density * settings.wave_speed**2 / fabric.stretch)
        radius = settings.clearance + 0.5 * fabric.thickness
        with wp.ScopedDevice("cpu"):
            builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, _GRAVITY, 0.0))
            newton.solvers.SolverStyle3D.register_custom_attributes(builder)
            panels = _flattened(np.asarray(vertices, np.float64)[triangles])
            newton.solvers.style3d.add_cloth_mesh(
                builder,
                pos=wp.vec3(0, 0, 0),
                rot=wp.quat_identity(),
                vel=wp.vec3(0, 0, 0),
                vertices=np.asarray(vertices, np.float64).tolist(),
                indices=np.asarray(triangles).ravel().tolist(),
                density=fabric.density,
                particle_radius=radius,
                panel_verts=panels.reshape(-1, 2).tolist(),
                panel_indices=list(range(3 * len(triangles))),
                tri_aniso_ke=wp.vec3(soft * fabric.stretch, soft * fabric.stretch, soft * fabric.shear),
                edge_aniso_ke=wp.vec3(fabric.bending),
            )
            collider = newton.Mesh(self._body, np.asarray(faces, np.int32).ravel(), compute_inertia=False)
            contact = newton.ModelBuilder.ShapeConfig(ke=settings.contact_stiffness, kd=0.0, mu=fabric.friction)
            builder.add_shape_mesh(body=-1, mesh=collider, cfg=contact)
            for index in pinned:
                builder.particle_mass[index] = _PIN_MASS
            model = builder.finalize()
            bending = model.edge_bending_properties.numpy().copy()
            bending[:, 0] = fabric.bending / _BENDING_EXCESS
            model.edge_bending_properties.assign(bending)
            model.soft_contact_ke = settings.contact_stiffness
            model.soft_contact_kd = 0.0
            model.soft_contact_mu = fabric.friction
            model.shape_collision_aabb_lower.assign(np.full((1, 3), -_REACH, np.float32))
            model.shape_collision_aabb_upper.assign(np.full((1, 3), _REACH, np.float32))
            self._collider = collider.mesh
            config = newton.solvers.SolverStyle3D.Config(
                iterations=settings.iterations, linear_iterations=settings.linear_iterations
            )
            self._solver = newton.solvers.SolverStyle3D(model, config=config)
            self._solver.linear_solver = _conjugate_gradient(len(vertices), self._solver.collision)
            if settings.self_collision:
                self._solver.collision.radius = settings.self_collision_radius
            else:
                collision = self._solver.collision
                collision.stiff_vf = collision.stiff_ee = collision.stiff_ef = 0.0
            self._pipeline = newton.CollisionPipeline(model, soft_contact_gap=settings.contact_gap)
            self._contacts = self._pipeline.contacts()
            self._now, self._next = model.state(), model.state()
            self._control = model.control()
        self._steps = 0

    @property
    def positions(self) -> NDArray[np.float32]:
        """A copy of the cloth's vertices (N, 3)."""
        return np.array(self._now.particle_q.numpy(), dtype=np.float32)

    def advance(self, body: NDArray[Any], pins: NDArray[Any], damping: float = 1.0) -> NDArray[np.float32]:
        """Move the body to `body` (V, 3) and the pinned vertices to `pins` (P, 3) over one frame; the cloth follows.

        damping  factor on all velocities after each substep; 1 leaves them
        Returns the new positions (N, 3).
        """
        _, wp = import_newton()
        target = np.asarray(body, np.float32)
        count = self._settings.substeps
        step = 1 / (self._settings.fps * count)
        with wp.ScopedDevice("cpu"):
            self._collider.velocities.assign((target - self._body) / np.float32(step * count))
            for index in range(count):
                if self._steps % _STEPS_PER_REBUILD == 0:
                    self._solver.rebuild_bvh(self._now)
                share = np.float32((index + 1) / count)
                self._collider.points.assign(self._body * (1 - share) + target * share)
                self._collider.refit()
                self._pipeline.collide(self._now, self._contacts)
                self._now.clear_forces()
                self._throw_pins(pins, step, count - index)
                carried = self._foresee(step)
                self._solver.step(self._now, self._next, self._control, self._contacts, step)
                self._now, self._next = self._next, self._now
                velocities = self._now.particle_qd.numpy() + _VELOCITY_KEPT * carried
                self._now.particle_qd.assign(velocities * np.float32(damping))
                self._steps += 1
        self._body = target.copy()
        return self.positions

    def _foresee(self, step: float) -> NDArray[np.float32]:
        """Move the cloth to where its velocities take it in this step, and return these velocities (N, 3).

        The solver starts each step where the last one ended, and its few iterations end long before cloth that turns
        is where inertia takes it: it falls as if through honey. So it starts here instead, with no velocity of its own;
        friction, which looks at the way since the start, is told the same by taking that way from the skin's.
        """
        velocities = np.array(self._now.particle_qd.numpy(), dtype=np.float32)
        self._now.particle_q.assign(self._now.particle_q.numpy() + velocities * np.float32(step))
        self._now.particle_qd.zero_()
        count = min(int(self._contacts.soft_contact_count.numpy()[0]), self._contacts.soft_contact_max)
        skin = np.array(self._contacts.soft_contact_body_vel.numpy())
        skin[:count] -= velocities[self._contacts.soft_contact_particle.numpy()[:count]]
        self._contacts.soft_contact_body_vel.assign(skin)
        return velocities

    def _throw_pins(self, targets: NDArray[Any], step: float, steps_left: int) -> None:
        """Give pinned particles the velocity that takes them the next part of their way, and weigh nothing."""
        if not len(self._pinned):
            return
        way = (targets - self._now.particle_q.numpy()[self._pinned]) / steps_left
        velocity = np.array(self._now.particle_qd.numpy())
        velocity[self._pinned] = way / step
        self._now.particle_qd.assign(velocity)
        force = np.zeros_like(velocity)
        force[self._pinned, 1] = -_GRAVITY * _PIN_MASS
        self._now.particle_f.assign(force)


def import_newton() -> tuple[Any, Any]:
    """The modules newton and warp, quiet. Raises GarmentcError where they aren't installed."""
    try:
        import warp as wp

        wp.config.log_level = wp.LOG_ERROR  # before newton initialises it: no banner
        wp.ScopedTimer.enabled = False  # the solver times its set-up there
        with native_stderr_closed():  # Warp's own library says there that it found no CUDA, whatever its log level
            wp.init()
        import newton
        import newton.solvers
    except ImportError as error:
        raise GarmentcError("simulation needs Newton; install it with: pip install 'garmentc[simulate]'") from error
    return newton, wp


def _conjugate_gradient(count: int, collision: Any) -> Any:
    from garmentc.simulation.conjugate_gradient import ConjugateGradient

    return ConjugateGradient(count, collision.contact_hessian_diagonal())


def _flattened(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangles (F, 3, 3) laid into the plane one by one, (F, 3, 2), first edge along x."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    along = first / length[:, None]
    x = np.einsum("fi,fi->f", second, along)
    flat = np.zeros((len(corners), 3, 2))
    flat[:, 1, 0] = length
    flat[:, 2, 0] = x
    flat[:, 2, 1] = np.linalg.norm(second - x[:, None] * along, axis=1)
    return flat
