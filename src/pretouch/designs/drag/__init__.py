"""Design a virtual drag, and predict the contact speed."""

from .design import design_drag, drag_by, drag_trade_off
from .limits import DragEffect
from .result import DragDesign, DragLimits, predict_drag

__all__ = ["DragDesign", "DragEffect", "DragLimits", "design_drag", "drag_by", "drag_trade_off", "predict_drag"]
