"""List the peers. A module is loaded when its peer is requested, so missing peers do not matter."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from .protocol import Peer

__all__ = ["OURS", "PEERS", "load"]

OURS: Final = "pretouch"
PEERS: Final = {
    "pretouch": "ours.Pretouch",
    "numpy": "numpy_peer.NumPy",
    "scipy": "scipy_peer.SciPy",
    "casadi": "casadi_peer.CasADi",
    "heyoka": "heyoka_peer.Heyoka",
    "jax": "jax_peer.Jax",
    "diffrax": "diffrax_peer.Diffrax",
    "mujoco": "mujoco_peer.MuJoCo",
}


def load(name: str) -> Peer:
    """Load one peer by its short name."""
    module, _, kind = PEERS[name].partition(".")
    peer: Peer = getattr(import_module(f"{__package__}.{module}"), kind)()
    return peer
