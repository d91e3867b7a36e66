//! File formats of cameras, of clouds, of spectra and of mapping software: decoding and encoding.
//!
//! Each module is one format. It handles bytes and text, independent of the drive, the pipeline and other formats, and
//! returns plain values in the units of the format's page. Readers limit memory by the size of the file. Damaged input
//! gives an error, never a panic.
//!
//! | kind | modules |
//! |---|---|
//! | points | [`ply`], [`pcd`], [`kitti`], [`nuscenes`], [`semantic_kitti`] over [`cloud`]; [`cloud_fields`]: names, units and scales of their fields |
//! | images | [`jpeg`], [`pgm`], [`tiff`], [`raw_mosaic`], [`band_image`], [`multipart`] |
//! | spectra | [`envi`], [`ecostress`], [`sensor_calibration`] |
//! | poses and grids | [`trajectory`] (TUM, KITTI, CSV), [`sbet`], [`smrmsg`], [`novatel`], [`pose_table`], [`gtx`], [`ntv2`], [`gps_time`] |
//! | calibrations | [`ladybug`] |
//! | containers | [`npy`], [`sqlite`] |
//!
//! **Never**: packets of LiDARs (crate `lidar`), the drive folder (crate `drive`), recordings of topics (crate `recording`), formats of
//! surveying (LAS, COPC, GeoTIFF).
//!
//! **Start reading** at [`ply`]: header, rows and writer of the format that every run writes.

pub mod band_image;
pub mod cloud;
pub mod cloud_fields;
pub mod ecostress;
pub mod envi;
pub mod gps_time;
pub mod gtx;
pub mod jpeg;
pub mod kitti;
pub mod ladybug;
pub mod multipart;
pub mod novatel;
pub mod npy;
pub mod ntv2;
pub mod nuscenes;
pub mod pcd;
pub mod pgm;
pub mod ply;
pub mod pose_table;
pub mod raw_mosaic;
pub mod sbet;
pub mod semantic_kitti;
pub mod sensor_calibration;
pub mod smrmsg;
pub mod sqlite;
pub mod tiff;
pub mod trajectory;
