"""One writer a control: a model file becomes the files that the control or its programmer takes."""
