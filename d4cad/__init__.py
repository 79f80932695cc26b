"""d4cad turns a picture, a prompt or a load case into an exact, editable CAD part."""
