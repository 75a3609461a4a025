//! Image files: PNG, JPEG, OpenEXR, Radiance HDR, PFM.
