"""Looking at compiled outfits: contact sheets drawn in numpy, and a page with a viewer.

The renderer needs no graphics driver, no display and no package beyond what the compiler itself needs, and draws the
same picture on every machine with the same numpy.
"""
