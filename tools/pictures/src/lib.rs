//! Pictures and charts of results.

pub mod bands;
pub mod class_color;
pub mod cloud_files;
pub mod cloud_picture;
pub mod cost_history;
pub mod material_color;
pub mod thinning;
