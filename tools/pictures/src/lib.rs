//! Pictures and charts of results that both `replica` and `replica-lab` draw.
//!
//! | what is drawn | module |
//! |---|---|
//! | point clouds from the street and from above, top-down rasters; statistics that choose what a picture shows | [`cloud_picture`] |
//! | which clouds a path stands for | [`cloud_files`] |
//! | colors of classes and materials | [`class_color`], [`material_color`] |
//! | bands of reflectances: statistics, diagnosis, charts | [`bands`] |
//! | CPU time and memory of the stages of a run | [`cost_history`] |
//! | lines with more points than can be seen | [`thinning`] |
//!
//! What it must never do: change a result, or decide whether one is good; it draws what it is given. Equal input gives equal bytes.
//! A picture that only one of the two programs draws belongs to that program.
//!
//! Where to begin reading: [`cloud_picture::render`], which splats the points of files onto a canvas, seen by a
//! [`cloud_picture::Camera`] and colored by a [`cloud_picture::Palette`].

pub mod bands;
pub mod class_color;
pub mod cloud_files;
pub mod cloud_picture;
pub mod cost_history;
pub mod material_color;
pub mod thinning;
