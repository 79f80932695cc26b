"""Ways from a Sketch to CAD files."""
