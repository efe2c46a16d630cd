"""Electronic data sheets (CiA 306), one for each kind of device: the master and the virtual nodes both read them."""

from __future__ import annotations

from pathlib import Path

EDS_FOLDER = Path(__file__).parent
