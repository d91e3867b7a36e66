//! File and packet formats of sensors and of mapping software: decoding and encoding.

pub mod atomic_file;
pub mod calendar;
pub mod cloud;
pub mod drive;
pub mod ecostress;
pub mod envi;
pub mod imu;
pub mod kitti;
pub mod ladybug;
pub mod manifest;
pub mod nmea;
pub mod npy;
pub mod nuscenes;
pub mod pcap;
pub mod pcd;
pub mod pgm;
pub mod ply;
pub mod problems;
pub mod raw_mosaic;
pub mod recording;
pub mod sensor_calibration;
pub mod text_file;
pub mod tiff;
pub mod toml_file;
pub mod trajectory;
pub mod velodyne;
