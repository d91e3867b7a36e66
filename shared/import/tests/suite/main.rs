//! All tests of the crate's public interface in one program.

mod boreas;
mod cloud_dialects;
mod clouds;
mod folders;
mod kitti_odometry;
mod kitti_raw;
mod las_file;
mod mandeye;
mod mandeye_gnss;
mod nuscenes_scene;
mod plain_folders;
mod ros;
mod ros_damage;
mod ros_limits;
mod ros_real;
mod support;
mod trajectory;
