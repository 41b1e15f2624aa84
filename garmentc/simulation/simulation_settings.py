"""How cloth is simulated: numbers that were found to work, not to be tuned per outfit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SimulationSettings:
    """Settings of the cloth simulation. Lengths in metres.

    fps, substeps          fixed time step: 1 / (fps * substeps) seconds; body frames are 1 / fps apart
    iterations             projective-dynamics iterations per substep
    linear_iterations      conjugate-gradient iterations within each; with 10, cloth on a slope sticks that should slide
    clearance              cloth keeps this far from the skin (plus half its thickness): the triangles between vertices
                           of a coarse mesh would else cut through convex skin
    contact_gap            contacts are looked for this far beyond the clearance
    contact_stiffness      N/m per vertex; many times the cloth's stretch, or tight cloth is pressed in; above
                           this, rounding of float32 positions adds friction
    wave_speed             m/s: fabrics in which stretch travels faster, sqrt(stretch / density), are made softer to
                           this, stretch and shear alike. The iterations don't bring stiffer cloth to where it should
                           be, and it falls as if through honey. A metre of any fabric still stretches by less than
                           two per cent under its weight
    self_collision         whether the cloth collides with itself, within twice self_collision_radius
    settle_frames          the rest pose is held for at most this many frames before the motion starts,
    settle_damping         with velocities damped by this factor per substep,
    settled_step           until no more than one vertex in a hundred moves further than this in a frame
    escape                 cloth farther than this from the body's bounding box has exploded
    """

    fps: float = 30.0
    substeps: int = 2
    iterations: int = 6
    linear_iterations: int = 20
    clearance: float = 0.004
    contact_gap: float = 0.02
    contact_stiffness: float = 3_000.0
    wave_speed: float = 25.0
    self_collision: bool = True
    self_collision_radius: float = 0.003
    settle_frames: int = 60
    settle_damping: float = 0.9
    settled_step: float = 0.0005
    escape: float = 3.0
