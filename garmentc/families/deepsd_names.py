"""Names in a DeePSD bundle's outfit graph: its inputs, its outputs, and where it may be cut to work in pieces."""

VERTICES = "vertices"
NORMALS = "normals"
NEIGHBORS = "neighbors"
WEIGHTS = "weights"
SHAPES = "blend_shapes"

LOCAL = "local"
"""Per-vertex descriptors, (N, 256)."""
CANDIDATES = "global_candidates"
"""What the global descriptor is the maximum of, (N, 256)."""
GLOBAL = "global"
"""The global descriptor, (1, 256)."""
