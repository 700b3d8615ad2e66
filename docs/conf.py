"""Settings of the documentation: `sphinx-build -W -b html docs docs/_build`, without network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from robid_core import __version__

project = "robid"
author = "The robid authors"
project_copyright = "The robid authors, Apache-2.0"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "generated_pages",
]
exclude_patterns = ["_build", "reference/**/README.md"]
default_role = "code"

# A reference that leads nowhere is a warning, and warnings are errors; but for these.
INTERNAL = (  # classes that public signatures mention and nobody makes by hand
    "ArmSensor|ArmSpectra|Axes|BatchDiverged|BatchedDynamics|BodyDerivatives|DriveArrays|FileProblems|Identified|LawRun|M|MotionSpectra|MotorLaws|Motions|"
    "MovingSamples|NamedUnknowns|PeriodicMotion|Registry|RobotDescription|SpeedFunctions|Start|Tasks|Tell|"
    "TorqueBlock|Variants|Visibility|WindowedArm|WindowedMotion|_LawEffect"
)
nitpicky = True
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(abc|collections\.abc|logging|npt|numpy|pathlib|pydantic)\..*",
    ),  # the site is built without network
    ("py:class", r"(Float|Complex|Int|Bool)Array"),  # names of types, in the table of `python/arrays`
    ("py:.*", rf"(robid_core\.[\w.]+\.)?({INTERNAL})"),
]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_class_signature = "separated"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"robid {version}"
html_static_path = ["static"]
html_css_files = ["charts.css"]
html_copy_source = False
html_show_sourcelink = False
copybutton_prompt_text = "$ "

# The example's own page, written by `generated_pages.example_run`.
html_extra_path = ["reference/extra"]
(Path(__file__).parent / "reference" / "extra").mkdir(parents=True, exist_ok=True)
exclude_patterns += ["reference/extra", "reference/figures"]
