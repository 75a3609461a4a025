//! From any mesh to a texture atlas: clean, cut into charts, flatten, pack.
