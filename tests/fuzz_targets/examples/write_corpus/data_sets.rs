//! Files of third-party data sets, and calibrations of rigs.

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};
use std::io::Cursor;

/// Bytes of the header of LAS 1.2.
const HEADER_BYTES: usize = 227;
/// Bytes of a record of point format 1.
const RECORD_BYTES: u16 = 28;

/// Twelve points of point format 1.
pub fn las(is_compressed: bool) -> Vec<u8> {
    let items = LazItemRecordBuilder::default_for_point_format_id(1, 0).expect("is a format");
    file(1, is_compressed.then(|| LazVlr::from_laz_items(items)))
}

/// Twelve points of point format 6, in layers and chunks of five points.
pub fn layered_laz() -> Vec<u8> {
    let items = LazItemRecordBuilder::default_for_point_format_id(6, 0).expect("is a format");
    file(6, Some(LazVlrBuilder::new(items).with_fixed_chunk_size(5).build()))
}

fn file(format: u8, vlr: Option<LazVlr>) -> Vec<u8> {
    let record_bytes = vlr.as_ref().map_or(RECORD_BYTES, |vlr| vlr.items_size() as u16);
    let mut records = Vec::new();
    for index in 0..12_i32 {
        records.extend([10_000 + 10 * index, -20_000, 2500].map(i32::to_le_bytes).concat());
        records.extend((7 * index as u16).to_le_bytes());
        records.extend(vec![0; usize::from(record_bytes) - 22]);
        records.extend((4321.25 + 0.02 * f64::from(index)).to_le_bytes());
    }
    let mut head = vec![0; HEADER_BYTES];
    head[..4].copy_from_slice(b"LASF");
    head[24..26].copy_from_slice(&[1, 2]);
    head[94..96].copy_from_slice(&(HEADER_BYTES as u16).to_le_bytes());
    head[105..107].copy_from_slice(&record_bytes.to_le_bytes());
    head[107..111].copy_from_slice(&12_u32.to_le_bytes());
    for axis in 0..3 {
        head[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&1e-3_f64.to_le_bytes());
    }
    let Some(vlr) = vlr else {
        head[104] = format;
        head[96..100].copy_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
        return [head, records].concat();
    };
    head[104] = 0x80 | format;
    head[100] = 1;
    let mut description = Vec::new();
    vlr.write_to(&mut description).expect("writes");
    let mut record = vec![0; 54];
    record[2..16].copy_from_slice(b"laszip encoded");
    record[18..20].copy_from_slice(&22_204_u16.to_le_bytes());
    record[20..22].copy_from_slice(&(description.len() as u16).to_le_bytes());
    let data_at = HEADER_BYTES + record.len() + description.len();
    head[96..100].copy_from_slice(&(data_at as u32).to_le_bytes());
    let mut file = Cursor::new([head, record, description].concat());
    file.set_position(data_at as u64);
    let mut compressor = LasZipCompressor::new(&mut file, vlr).expect("opens");
    compressor.compress_many(&records).expect("compresses");
    compressor.done().expect("ends");
    drop(compressor);
    file.into_inner()
}

/// Several files in one input.
fn joined(files: &[&str]) -> Vec<u8> {
    files.join("\0").into_bytes()
}

pub const MANDEYE_IMU: &str = "timestamp gyroX gyroY gyroZ accX accY accZ imuId timestampUnix\n\
    4321250000000 0.1 -0.2 0.3 0.01 0 1.0 0 1700000000000000000\n4321255000000 0.1 -0.2 0.3 0.01 0 1.0 1 1700000000000000000\n\
    4321260000000 0.1 -0.2 0.3 0.01 0 1.0 0 1700000000000000000\n";

/// Two fixes as sentences, and as values.
pub fn mandeye_gnss() -> Vec<u8> {
    joined(&[
        "4321250000000 1700000000000 $GPGGA,123519.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*69\n\
         4321250000000 1700000000000 $GPRMC,123519.00,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*44\n",
        "54651848940 5156.43798828125 2009.1610107421875 122.2 1.25 8 35.8 nan 14:51:42 1\n\
         54751848940 51.94063313802083 20.15268351236979 122.2 1.25 8 35.8 nan 14:51:43 1 1700000000000\n",
    ])
}

/// A Boreas sequence of one sweep and one image.
pub fn boreas() -> Vec<u8> {
    joined(&[
        "0.731688868873821 -0.681638760023334 0 0\n0.681638760023334 0.731688868873821 0 0\n0 0 1 0.13\n0 0 0 1\n",
        "0.731688868873821 -0.681638760023334 0 0\n0 0 -1 -0.3\n0.681638760023334 0.731688868873821 0 -0.3\n0 0 0 1\n",
        "14.5 0 10 0\n0 14.5 5 0\n0 0 1 0\n0 0 0 1\n",
        "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n\
         1630597330954834,623422.5,4848820.25,153.5,0,0,0,0.01,0.02,0.5,0,0,0\n\
         1630597331054834,623423.5,4848820.25,153.5,0,0,0,0.01,0.02,0.5,0,0,0\n",
        "GPSTime,angvel_z,angvel_y,angvel_x,accelz,accely,accelx\n1630597330.954834,0.03,0.02,0.01,-9.8,0.2,0.1\n\
         1630597330.964834,0.03,0.02,0.01,-9.8,0.2,0.1\n",
    ])
}

/// A scene of one sweep and one image.
pub fn nuscenes_tables() -> Vec<u8> {
    let pose = r#""translation":[1.7,0.0,1.5],"rotation":[0.5,-0.5,0.5,-0.5]"#;
    let lens = "[[1266.4,0.0,816.3],[0.0,1266.4,491.5],[0.0,0.0,1.0]]";
    let sensor = |token: &str, of: &str, lens: &str| {
        format!(r#"{{"token":"{token}","sensor_token":"{of}",{pose},"camera_intrinsic":{lens}}}"#)
    };
    let data = |token: &str, sensor: &str, size: [u32; 2], file: &str| {
        let [width, height] = size;
        format!(
            r#"{{"token":"{token}","sample_token":"a","ego_pose_token":"p","calibrated_sensor_token":"{sensor}","timestamp":1532402927000000,"is_key_frame":true,"width":{width},"height":{height},"filename":"{file}"}}"#
        )
    };
    let lidar = data("l", "c0", [0, 0], "samples/LIDAR_TOP/a__LIDAR_TOP__1.pcd.bin");
    let camera = data("f", "c1", [1600, 900], "samples/CAM_FRONT/a__CAM_FRONT__1.jpg");
    joined(&[
        r#"[{"token":"s","name":"scene-0061","log_token":"log"}]"#,
        r#"[{"token":"log","logfile":"a"}]"#,
        r#"[{"token":"s0","channel":"LIDAR_TOP"},{"token":"s1","channel":"CAM_FRONT"}]"#,
        &format!("[{},{}]", sensor("c0", "s0", "[]"), sensor("c1", "s1", lens)),
        r#"[{"token":"a","scene_token":"s"}]"#,
        &format!("[{lidar},{camera}]"),
        &format!(r#"[{{"token":"p",{pose}}}]"#),
        &format!(r#"[{{"sample_token":"a","instance_token":"i","size":[2.0,4.5,3.0],{pose}}}]"#),
        r#"[{"token":"i","category_token":"k"}]"#,
        r#"[{"token":"k","name":"vehicle.car","index":1}]"#,
        r#"[{"sample_data_token":"l","filename":"lidarseg/v1.0-mini/a.bin"}]"#,
    ])
}

const RIGID: &str = "calib_time: 25-May-2012 16:47:16\nR: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n";
const CAM_TO_CAM: &str = "S_rect_02: 20 10\nR_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_02: 7 0 10 4.5 0 7 5 0 0 0 1 0\n";

pub fn kitti_raw() -> Vec<u8> {
    let time = "2011-09-26 13:02:25.594360375\n";
    let record =
        "49.015 8.43 116.4 0.03 0.01 -0.2 -4 0.2 4 0 0 0.1 0.2 9.8 0.1 0.2 9.8 0 0 0.1 0 0 0.1 0.05 0.03 4 10 4 4 0\n";
    joined(&[RIGID, RIGID, CAM_TO_CAM, time, time, record])
}

pub fn plain_tables() -> Vec<u8> {
    let imu = "timestamp,ax,ay,az,wx,wy,wz\n1583836591.18,0.1,0.2,9.81,0,0,0.1\n1583836591.28,0.1,0.2,9.81,0,0,0.1\n";
    let poses = "1583836591.182 1 2 3 0 0 0 1\n1583836592.182 2 2 3 0 0 0 1\n";
    joined(&["1583836591.182590976\n", imu, poses])
}

pub const KALIBR: &str = "cam0:\n  T_cam_imu:\n  - [0.0, -1.0, 0.0, 0.01]\n  - [0.0, 0.0, -1.0, 0.02]\n  - [1.0, 0.0, 0.0, 0.03]\n\
    \x20 - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  distortion_coeffs: [-0.01, 0.002, 0.0, 0.0]\n\
    \x20 distortion_model: equidistant\n  intrinsics: [380.0, 381.0, 510.0, 400.0]\n  resolution: [1024, 800]\n\
    \x20 timeshift_cam_imu: 0.0025\n";
pub const OPENCV: &str = "%YAML:1.0\nimage_width: 640\nimage_height: 480\ncamera_name: front\n\
    camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n  data: [500., 0., 320., 0., 500., 240., 0., 0., 1.]\n\
    distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.0, 0.0, 0.0]}\n";
pub const FRAMES: &str = "transforms:\n- header: {frame_id: base_link}\n  child_frame_id: velodyne\n\
    \x20 transform: {translation: {x: 1.0, y: 0.0, z: 1.8}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}\n\
    - header: {frame_id: base_link}\n  child_frame_id: imu\n\
    \x20 transform: {translation: {x: 1.5, y: 0.0, z: 1.5}, rotation: {x: -0.5, y: 0.5, z: -0.5, w: 0.5}}\n---\n";

/// A folder of KITTI odometry, and one of KITTI raw.
pub fn rig_kitti() -> Vec<Vec<u8>> {
    let odometry = "P0: 7.0 0.0 6.0 0.0 0.0 7.0 1.8 0.0 0.0 0.0 1.0 0.0\nP2: 7.0 0.0 6.0 4.5 0.0 7.0 1.8 -0.1 0.0 0.0 1.0 3.7e-03\n\
        Tr: 0 -1 0 -0.01 0 0 -1 -0.05 1 0 0 -0.3\n";
    vec![joined(&[odometry]), joined(&["", CAM_TO_CAM, RIGID, RIGID])]
}

pub fn rig_nuscenes() -> Vec<u8> {
    let entry = |token: &str, sensor: &str, lens: &str| {
        format!(
            r#"{{"token":"{token}","sensor_token":"{sensor}","translation":[1.7,0.0,1.5],"rotation":[0.5,-0.5,0.5,-0.5],"camera_intrinsic":{lens}}}"#
        )
    };
    let lens = "[[1266.4,0.0,816.3],[0.0,1266.4,491.5],[0.0,0.0,1.0]]";
    joined(&[
        &format!("[{},{}]", entry("c0", "s0", "[]"), entry("c1", "s1", lens)),
        r#"[{"token":"s0","channel":"LIDAR_TOP"},{"token":"s1","channel":"CAM_FRONT"}]"#,
        r#"[{"filename":"samples/CAM_FRONT/a__CAM_FRONT__1.jpg","calibrated_sensor_token":"c1"}]"#,
    ])
}
