//! Pictures and charts of results that both `replica` and `replica-lab` draw.
//!
//! | what is drawn | module |
//! |---|---|
//! | point clouds from the street and from above, top-down rasters; statistics that select the content of a picture | [`cloud_picture`] |
//! | the clouds of a path | [`cloud_files`] |
//! | colors of classes and materials | [`class_color`], [`material_color`] |
//! | bands of reflectances: statistics, diagnosis, charts | [`bands`] |
//! | CPU time and memory of the stages of a run | [`cost_history`] |
//! | lines with more points than can be seen | [`thinning`] |
//!
//! It must never change a result, or decide whether a result is good; it only draws. Equal input gives equal bytes.
//! A picture that only one of the two programs draws belongs to that program.
//!
//! Start reading at [`cloud_picture::render`], which splats the points of files onto a canvas, seen by a
//! [`cloud_picture::Camera`] and colored by a [`cloud_picture::Palette`].

pub mod bands;
pub mod class_color;
pub mod cloud_files;
pub mod cloud_picture;
pub mod cost_history;
pub mod material_color;
pub mod thinning;
