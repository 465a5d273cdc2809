"""Settings of the gallery: python/examples/gallery, each script with its picture and a notebook."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sphinx_gallery.sorting import ExplicitOrder

__all__ = ["ORDER", "SCRIPTS", "order", "settings"]

SCRIPTS = Path(__file__).resolve().parents[2] / "python" / "examples" / "gallery"
ORDER = (
    "log_to_controller.py",
    "measured_loop.py",
    "model_comparison.py",
    "residual.py",
    "prediction_band.py",
    "search.py",
    "tuning.py",
    "margins.py",
    "with_and_without_feedback.py",
    "circle.py",
    "learnt_raster.py",
    "hardware.py",
    "step_response.py",
    "campaign.py",
)
order = ExplicitOrder(list(ORDER))


def settings() -> dict[str, Any]:
    """Return what sphinx-gallery is given."""
    return {
        "examples_dirs": str(SCRIPTS),
        "gallery_dirs": "gallery",
        "filename_pattern": r"\.py$",
        "within_subsection_order": "gallery.order",
        "doc_module": ("piezotrack",),
        "reference_url": {"piezotrack": None},
        "backreferences_dir": "gallery/backreferences",
        "abort_on_example_error": True,
        "capture_repr": (),
        "download_all_examples": False,
        "show_memory": False,
        "show_signature": False,
        "remove_config_comments": True,
        "min_reported_time": 1e9,
        "write_computation_times": False,
        # The reference shows the scripts that write a name, not all that have such a result.
        "inspect_global_variables": False,
        "image_scrapers": ("matplotlib",),
        "matplotlib_animations": False,
    }
