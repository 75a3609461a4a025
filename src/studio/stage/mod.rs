//! The stage: the mesh in 3-D, drawn by wgpu.
