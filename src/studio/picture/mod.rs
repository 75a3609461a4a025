//! Linear pictures on the screen: zoom, pan, exposure, false colour, numbers on pixels.
