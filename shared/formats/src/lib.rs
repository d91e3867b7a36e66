//! Files and packets of the field: bytes in, values out, and back.

pub mod atomic_file;
pub mod manifest;
pub mod ply;
pub mod trajectory;
