"""The body: SMPL's skeleton and formula, the default body, users' bodies, parameters and motions."""

from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.gender import GENDERS
from garmentc.smpl.load import load_body
from garmentc.smpl.motion import Motion

__all__ = ["GENDERS", "BodyModel", "Motion", "load_body", "load_default_body"]
