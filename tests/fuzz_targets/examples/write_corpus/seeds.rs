//! The seeds.

use crate::{data_sets, ros, runs};
use drive::imu::{ImuSample, csv_from_samples};
use formats::cloud::CloudPoint;
use formats::pgm::pgm_from_samples;
use formats::ply::{Header, Kind, PlyWriter};
use formats::sensor_calibration::{CorrectionMatrix, Curve, FilterBand, SensorCalibration, VirtualBand};
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, numbered, tum_from_trajectory};
use formats::{envi, kitti, nuscenes, pcd};
use geometry::{Pose, Stamp};
use image::{ImageFormat, RgbImage};
use lidar::nmea::{Fix, gga_from_fix, rmc_from_fix};
use lidar::pcap::Writer;
use lidar::velodyne::{DATA_PORT, Model, PulseStatus, RawBlock, RawReturn, encode_data_packet, encode_position_packet};
use messages::{ByteTable, ClassTopic, TickRow};
use recording::RecordingWriter;
use run::state_file::{RunnerState, write_state};
use stage::encode_state;
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;

/// 2023-11-14, 1.5 s before a full hour.
const BEGIN: Stamp = Stamp(1_699_999_200_000_000_000 - 1_500_000_000);

/// Files of each target.
pub fn all() -> Vec<(&'static str, Vec<Vec<u8>>)> {
    let (trajectory, poses) = trajectory();
    vec![
        ("pcap", vec![capture(Model::Hdl32e), capture(Model::Vlp16), fragments()]),
        ("pcapng", vec![pcapng()]),
        ("hdl32e", vec![packet(Model::Hdl32e, 0), position()]),
        ("vlp16", vec![packet(Model::Vlp16, 0), position()]),
        ("hdl64e", vec![packet(Model::Hdl64e, 0)]),
        ("hesai", vec![hesai_40p(), hesai(6, 32, 8, 24), hesai(3, 64, 4, 24)]),
        ("ouster", vec![ouster(16, 12, 4, 0), ouster(12, 4, 0, 32), ouster(12, 12, 0, 32), ouster(12, 16, 0, 32)]),
        ("robosense", vec![robosense(1), robosense(2)]),
        ("livox", vec![mid360(1, 14), mid360(3, 10), avia(2, 96 * 14), avia(4, 48 * 28)]),
        ("vlp32c", vec![packet(Model::Vlp32c, 0), position()]),
        ("ouster_metadata", vec![METADATA.into()]),
        ("hesai_angles", vec![angles_csv(40)]),
        ("robosense_angles", vec![angles_csv(16), beam_angles(32)]),
        ("velodyne_calibration", vec![lasers_xml(), lasers_yaml()]),
        ("nmea", vec![log().into_bytes()]),
        ("imu", vec![imu().into_bytes()]),
        ("png", vec![picture(ImageFormat::Png)]),
        ("jpeg", vec![picture(ImageFormat::Jpeg)]),
        ("multipart", vec![multipart()]),
        ("pgm", vec![pgm_from_samples(20, 10, 4095, &[77; 200]), pgm_from_samples(20, 10, 255, &[77; 200])]),
        ("tiff", vec![tiff()]),
        ("raw_mosaic", vec![tiff(), pgm_from_samples(20, 10, 4095, &[77; 200])]),
        ("ply", vec![ply()]),
        ("pcd", vec![pcd::pcd_from_points(&points()), PCD_TEXT.to_vec()]),
        ("pcd_compressed", vec![PCD_COMPRESSED.to_vec()]),
        ("kitti", vec![kitti::bin_from_points(&points())]),
        ("nuscenes", vec![nuscenes::bin_from_points(&points().into_iter().zip(0..32).collect::<Vec<_>>())]),
        ("npy", vec![npy()]),
        ("envi", vec![cube()]),
        ("spectral_library", vec![library()]),
        ("ecostress", vec![SPECTRUM.as_bytes().to_vec()]),
        ("sensor_calibration", vec![sensor().to_xml().into_bytes()]),
        ("ladybug", vec![LENS.as_bytes().to_vec()]),
        ("tum", vec![tum_from_trajectory(&trajectory).into_bytes()]),
        ("trajectory_csv", vec![csv_from_trajectory(&trajectory).into_bytes()]),
        ("kitti_poses", vec![poses.into_bytes()]),
        ("check_points", vec![CHECK_POINTS.as_bytes().to_vec()]),
        ("geoid_grid", vec![geoid_grid()]),
        ("datum_grid", vec![datum_grid()]),
        ("launch_file", vec![LAUNCH.as_bytes().to_vec()]),
        ("drive_manifest", vec![DRIVE.as_bytes().to_vec()]),
        ("mcap", vec![mcap()]),
        ("model", vec![segmentation::ground_quasi_flat::encode(&ground::Parameters::default()).expect("encodes")]),
        ("state", states()),
        ("control", CONTROL.map(|text| text.as_bytes().to_vec()).to_vec()),
        ("ros1_bag", vec![ros::ros1_bag("none"), ros::ros1_bag("bz2"), ros::ros1_bag("lz4")]),
        ("ros2_sqlite", vec![ros::database()]),
        ("ros2_mcap", vec![ros::mcap(""), ros::mcap("lz4"), ros::mcap("zstd")]),
        ("sqlite", vec![ros::database()]),
        ("ros2_metadata", vec![ros::BAG.into()]),
        ("ros_messages", ros::messages()),
        ("las", vec![data_sets::las(false)]),
        ("laz", vec![data_sets::las(true), data_sets::layered_laz()]),
        ("mandeye_imu", vec![data_sets::MANDEYE_IMU.into()]),
        ("mandeye_gnss", vec![data_sets::mandeye_gnss()]),
        ("boreas", vec![data_sets::boreas()]),
        ("nuscenes_tables", vec![data_sets::nuscenes_tables()]),
        ("kitti_raw", vec![data_sets::kitti_raw()]),
        ("plain_tables", vec![data_sets::plain_tables()]),
        ("rig_yaml", [data_sets::KALIBR, data_sets::OPENCV, data_sets::FRAMES].map(Vec::from).to_vec()),
        ("rig_ladybug", vec![LENS.into()]),
        ("rig_kitti", data_sets::rig_kitti()),
        ("rig_nuscenes", vec![data_sets::rig_nuscenes()]),
        ("run_texts", runs::run_texts()),
        ("summary", vec![runs::summary()]),
        ("wiring", vec![runs::wiring()]),
        ("state_head", vec![runs::state_head()]),
        ("saved_message", runs::saved_messages()),
        ("spherical_model", runs::spherical_models()),
    ]
}

pub const METADATA: &str = r#"{"beam_intrinsics": {"beam_altitude_angles": [10, -10], "beam_azimuth_angles": [2, -2],
    "beam_to_lidar_transform": [1, 0, 0, 20, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1]}, "config_params": {"lidar_mode": "512x10"},
    "lidar_data_format": {"columns_per_frame": 512, "columns_per_packet": 16, "pixels_per_column": 2, "column_window": [0, 511],
    "udp_profile_lidar": "LEGACY"}, "sensor_info": {"prod_sn": "5"},
    "lidar_intrinsics": {"lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1]}}"#;

/// 4 points whose coordinates are copies of each other.
const PCD_COMPRESSED: &[u8] =
    b"VERSION 0.7\nFIELDS x y z t\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\n\
    DATA binary_compressed\n\x10\0\0\0\x40\0\0\0\x03\0\0\x80\x3f\xe0\x23\x03\x03\x40\x42\x0f\0\xe0\x03\x03";
const PCD_TEXT: &[u8] =
    b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 3\nDATA ascii\n1 2 3\n4 5 6\n7 8 9\n";
const SPECTRUM: &str =
    "Name: Concrete\nX Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\n\n0.4 10\n0.5 12.5\n0.6 13\n";
const LENS: &str = "SerialNumber 1\nResolution 20 10\nBeginCamera\nId 0\nfocalLength 0.5 1\n\
    CamToLadybugEulerZYX 0.1 0.2 0.3 0.04 0.05 0.06\nRectifiedSpline 0 0\nCenter 0 0 1 0.5 0.5\nTopLeft -1 -1 1 0 0\n\
    BottomLeft -1 1 1 0 1\nTopRight 1 -1 1 1 0\nBottomRight 1 1 1 1 1\nEndCamera\nBeginWarp\nId 0\n\
    KnotsX 0 0 0 0 1 1 1 1\nKnotsY 0 0 0 0 1 1 1 1\nNumberCoefs 4 4\nCoefs\n1 2 3 4\n5 6 7 8\n9 8 7 6\n5 4 3 2\nEndWarp\n";
const LAUNCH: &str = "# A comment\n[run]\ndrive = \"drives/sample\"\noutput = 'out'\nbarrier_s = 5.0\n\n[acquire]\nstart_s = 1\n\n\
    [instance]\nthings = [{ class = 'vehicles', max_height_m = 4.0, min_points = 200 }]\n[export]\nformats = [\"ply\"]\n";
const DRIVE: &str = "version = 1\nname = \"x\"\n[lidar]\nmodel = \"hdl64e\"\nformat = \"bin\"\nfolder = \"lidar\"\n\
    body_from_lidar = { translation = [0, 0, 1.9], rotation = [0, 0, 0, 1] }\n\
    [[camera]]\nname = \"front\"\nfolder = \"camera\"\nexposure_nanos = 5000000\n\
    body_from_camera = { translation = [0, 0, 1], rotation = [0, 0, 0, 1] }\n\
    model = { kind = \"pinhole\", width = 64, height = 48, fx = 60, fy = 60, cx = 32, cy = 24 }\n\
    [gnss]\nfile = \"gnss.nmea\"\norigin = [48.8, 2.3, 100.0]\nantenna_in_body = [0, 0, 2]\n[imu]\nfile = \"imu.csv\"\n";
const CONTROL: [&str; 4] = [
    r#"{"stop":{"now":false}}"#,
    r#"{"swap":{"stage":"infer","back":false,"changes":[{"unset":{"table":"infer","key":"model"}},{"set":{"table":"infer","key":"threads","value":"4"}}]}}"#,
    r#"{"working":"draining"}"#,
    r#"{"refused":["a reason","another"]}"#,
];

pub fn packet(model: Model, number: i64) -> Vec<u8> {
    let blocks = std::array::from_fn(|index| {
        let azimuth = ((number * 12 + index as i64) * 17 % 36_000) as u16;
        let one = |k: usize| RawReturn { range_2mm: 1000 + 700 * k as u16, intensity: 8 * k as u8 };
        RawBlock { azimuth, is_lower: model == Model::Hdl64e && index % 2 == 1, returns: std::array::from_fn(one) }
    });
    encode_data_packet(model, BEGIN.plus_nanos(number * 552_960), &blocks).to_vec()
}

/// Blocks of a Hesai: angle and returns.
fn hesai_blocks(flag: &[u8], n_blocks: u16, n_beams: usize, return_bytes: usize) -> Vec<u8> {
    let one = |beam: usize| [(beam as u16 * 50 + 500).to_le_bytes().to_vec(), vec![9; return_bytes - 2]].concat();
    let block = |block: u16| {
        let angle = (block / 2 * 20).to_le_bytes();
        [flag.to_vec(), angle.to_vec(), (0..n_beams).flat_map(one).collect()].concat()
    };
    (0..n_blocks).flat_map(block).collect()
}

fn hesai_40p() -> Vec<u8> {
    let mut bytes = hesai_blocks(&[0xff, 0xee], 10, 40, 3);
    bytes.resize(1254, 0);
    bytes.extend([0x39, 0x42, 23, 11, 14, 22, 13, 20]);
    bytes
}

fn hesai(major: u8, n_beams: u8, n_blocks: u8, tail: usize) -> Vec<u8> {
    let mut bytes = vec![0xee, 0xff, major, 1, 0, 0, n_beams, n_blocks, 1, 4, 2, 1];
    bytes.extend(hesai_blocks(&[], u16::from(n_blocks), usize::from(n_beams), 4));
    // The return mode of one model, reserved in the other: two echoes.
    bytes.extend([0; 10]);
    bytes.extend([0x39; 7]);
    bytes.resize(bytes.len() + tail - 17 + 4, 1);
    bytes
}

/// A packet of an Ouster with two beams: sizes of the headers of columns, pixels, footers of columns, and header of the packet.
pub fn ouster(column_header: usize, pixel: usize, column_footer: usize, header: usize) -> Vec<u8> {
    let mut bytes = vec![1, 0];
    bytes.resize(header, 0);
    for column in 0..16_u16 {
        let begin = bytes.len();
        bytes.extend((1_000_000 + u64::from(column) * 195_312).to_le_bytes());
        bytes.extend(column.to_le_bytes());
        bytes.resize(begin + column_header, 1);
        bytes.extend((0..2 * pixel).map(|at| [0x10, 0x20, 1, 7][at % 4]));
        bytes.resize(bytes.len() + column_footer, 0xff);
    }
    bytes.resize(bytes.len() + header, 0);
    bytes
}

fn robosense(model: u8) -> Vec<u8> {
    let mut bytes = vec![0x55, 0xaa, 0x05, 0x0a, 0x5a, 0xa5, 0x50, 0xa0];
    bytes.resize(20, 0);
    bytes.extend([23, 11, 14, 22, 13, 20, 0, 7, 0, 9, model]);
    bytes.resize(42, 0);
    for block in 0..12_u16 {
        bytes.extend([0xff, 0xee]);
        bytes.extend((block * 40).to_be_bytes());
        bytes.extend((0..32_u8).flat_map(|laser| [7, laser, 9]));
    }
    bytes.resize(1248, 0);
    bytes
}

fn mid360(kind: u8, point_bytes: u16) -> Vec<u8> {
    let mut bytes = vec![0];
    for value in [36 + 8 * point_bytes, 350, 8] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.resize(36, 0);
    bytes[10] = kind;
    bytes.extend((0..8 * point_bytes).map(|at| (at % 5) as u8));
    bytes
}

fn avia(kind: u8, n_bytes: usize) -> Vec<u8> {
    let mut bytes = vec![5, 0, 0, 0, 0, 0, 0, 0, 3, kind, 23, 11, 14, 22, 0, 0, 0, 1];
    bytes.extend((0..n_bytes).map(|at| (at % 5) as u8));
    bytes
}

/// All lasers of an HDL-64E.
fn lasers_xml() -> Vec<u8> {
    let laser = |id: usize| {
        format!(
            "<item><px><id_>{id}</id_><rotCorrection_>-5.3</rotCorrection_><vertCorrection_>-7.{id}</vertCorrection_>\
             <distCorrection_>111</distCorrection_></px></item>\n"
        )
    };
    let lasers: String = (0..64).map(laser).collect();
    let head = "<!DOCTYPE boost_serialization>\n<DB><distLSB_>0.2</distLSB_><points_>";
    format!("{head}{lasers}</points_></DB>").into_bytes()
}

fn lasers_yaml() -> Vec<u8> {
    let laser = |id: usize| format!("- {{laser_id: {id}, rot_correction: 0.02, vert_correction: -0.{id}}}\n");
    let lasers: String = (0..16).map(laser).collect();
    format!("lasers:\n{lasers}num_lasers: 16\ndistance_resolution: 0.002\n").into_bytes()
}

fn angles_csv(n_beams: i32) -> Vec<u8> {
    let line = |beam: i32| format!("{},{}.5,-1.042\n", beam + 1, 15 - beam);
    format!("Laser id,Elevation,Azimuth\n{}", (0..n_beams).map(line).collect::<String>()).into_bytes()
}

/// Elevation and azimuth of each beam.
fn beam_angles(n_beams: i32) -> Vec<u8> {
    let line = |beam: i32| format!("{},0.5\n", 15 - beam);
    (0..n_beams).map(line).collect::<String>().into_bytes()
}

/// A data packet in three fragments.
fn fragments() -> Vec<u8> {
    let mut whole = Vec::new();
    Writer::new(&mut whole).expect("writes").write_udp(BEGIN, DATA_PORT, &packet(Model::Hdl32e, 3)).expect("writes");
    let (file_header, record) = whole.split_at(24);
    let (head, datagram) = record[16..].split_at(34);
    let mut bytes = file_header.to_vec();
    for (number, part) in datagram.chunks(480).enumerate() {
        let mut frame = [head, part].concat();
        frame[16..18].copy_from_slice(&(20 + part.len() as u16).to_be_bytes());
        let more = if (number + 1) * 480 < datagram.len() { 0x2000 } else { 0 };
        frame[20..22].copy_from_slice(&(more | (60 * number as u16)).to_be_bytes());
        bytes.extend(&record[..8]);
        bytes.extend([frame.len() as u32; 2].iter().flat_map(|length| length.to_le_bytes()));
        bytes.extend(frame);
    }
    bytes
}

fn position() -> Vec<u8> {
    encode_position_packet(BEGIN, PulseStatus::Locked, &rmc_from_fix(&fix(0))).to_vec()
}

fn capture(model: Model) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new()).expect("writes");
    writer.write_udp(BEGIN, 8308, &position()).expect("writes");
    for number in 0..5 {
        // A revolution ends between the third and the fourth.
        let packet = packet(model, if number < 3 { 170 + number } else { 180 + number });
        writer.write_udp(BEGIN.plus_nanos(number * 552_960), DATA_PORT, &packet).expect("writes");
    }
    writer.finish().expect("writes")
}

fn pcapng() -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let total = (12 + body.len().next_multiple_of(4)) as u32;
        let mut bytes = [kind.to_le_bytes(), total.to_le_bytes()].concat();
        bytes.extend(body);
        bytes.resize(total as usize - 4, 0);
        bytes.extend(total.to_le_bytes());
        bytes
    };
    let mut file = block(0x0a0d_0d0a, &[0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
    // Interface 0: Ethernet, nanoseconds.
    file.extend(block(1, &[1, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]));
    for number in 0..3 {
        let stamp = BEGIN.plus_nanos(number * 552_960);
        let mut classic = Vec::new();
        let mut writer = Writer::new(&mut classic).expect("writes");
        writer.write_udp(stamp, DATA_PORT, &packet(Model::Hdl32e, number)).expect("writes");
        let frame = &classic[40..];
        let words = [0, (stamp.0 as u64 >> 32) as u32, stamp.0 as u32, frame.len() as u32, frame.len() as u32];
        file.extend(block(6, &[words.map(u32::to_le_bytes).concat(), frame.to_vec()].concat()));
        file.extend(block(5, &[0; 20]));
    }
    file
}

fn fix(second: i64) -> Fix {
    Fix {
        stamp: BEGIN.plus_nanos(second * 1_000_000_000),
        position_deg: [48.0, 2.0],
        altitude_m: Some(100.0),
        speed_mps: Some(1.0),
        course_deg: Some(2.0),
        hdop: Some(1.0),
        satellites: 9,
        quality: 1,
        vdop: None,
        deviation: None,
    }
}

fn log() -> String {
    (0..6)
        .flat_map(|second| [gga_from_fix(&fix(second), 44.0), "\r\n".into(), rmc_from_fix(&fix(second)), "\r\n".into()])
        .collect()
}

fn imu() -> String {
    let sample = |i: i64| ImuSample { stamp: Stamp(i), acceleration: [0.0, 1.0, 9.81], angular_rate: [0.1; 3] };
    csv_from_samples(&(0..12).map(sample).collect::<Vec<_>>())
}

pub fn picture(format: ImageFormat) -> Vec<u8> {
    let image = RgbImage::from_fn(24, 16, |x, y| image::Rgb([x as u8 * 9, y as u8 * 13, (x * y) as u8]));
    let mut bytes = Vec::new();
    image.write_to(&mut Cursor::new(&mut bytes), format).expect("encodes");
    bytes
}

/// 4 x 2 pixels with 4 bands of 16 bits, uncompressed.
fn tiff() -> Vec<u8> {
    let fields = [(256, 4), (257, 2), (258, 16), (259, 1), (262, 1), (273, 122), (277, 4), (278, 2), (279, 64)];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, value) in fields {
        bytes.extend([u16::to_le_bytes(tag), 4_u16.to_le_bytes()].concat());
        bytes.extend([1_u32.to_le_bytes(), u32::to_le_bytes(value)].concat());
    }
    bytes.extend([0; 4]);
    bytes.extend((0..32_u16).flat_map(u16::to_le_bytes));
    bytes
}

fn points() -> Vec<CloudPoint> {
    (1..33).map(|i| CloudPoint { x: i as f32, y: -1.5, z: 0.25, intensity: 0.5 }).collect()
}

fn ply() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.ply");
    let header = Header::new([("x", Kind::Float), ("y", Kind::Double), ("red", Kind::UChar), ("class", Kind::Int)]);
    let header = header.comment("made by hand").info("frame world");
    let mut writer = PlyWriter::create(&path, &header, 20).expect("creates");
    writer
        .write_each(20, |i, row| {
            row.f32(i as f32).f64(0.5).u8(7).i32(-3);
        })
        .expect("writes");
    writer.finish().expect("writes");
    fs::read(path).expect("reads")
}

fn npy() -> Vec<u8> {
    let mut header = String::from("{'descr': '<f4', 'fortran_order': False, 'shape': (8, 3), }");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend((0..24_u8).flat_map(|i| f32::from(i).to_le_bytes()));
    bytes
}

/// Header and data, as the target separates them.
fn cube() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut header = envi::Header { wavelength_units: "nm".to_owned(), ..envi::Header::new(4, 3, 4) };
    header.wavelengths = vec![500.0, 510.0, 520.0, 530.0];
    let path = folder.path().join("cube.hdr");
    envi::write(&path, &envi::Image { header, values: vec![0.5; 48] }).expect("writes");
    let files = folder.path().read_dir().expect("lists").map(|entry| entry.expect("is there").path());
    let data = files.into_iter().find(|file| *file != path).expect("the data");
    [fs::read(&path).expect("reads"), vec![0], fs::read(data).expect("reads")].concat()
}

fn library() -> Vec<u8> {
    let header = "ENVI\nsamples = 4\nlines = 2\nbands = 1\nheader offset = 0\nfile type = ENVI Spectral Library\ndata type = 4\n\
        interleave = bsq\nbyte order = 0\nwavelength units = Nanometers\nwavelength = { 400, 500, 600, 700 }\n\
        spectra names = { concrete, grass }\n";
    [header.as_bytes(), &[0], &(0..8_u8).flat_map(|i| f32::from(i).to_le_bytes()).collect::<Vec<_>>()].concat()
}

/// A camera of 2 x 2 bands.
fn sensor() -> SensorCalibration {
    let response = Curve::from_samples(vec![(480.0, 0.1), (500.0, 0.4), (520.0, 0.2)]);
    let band = FilterBand { selected: true, peaks: Vec::new(), response };
    let rows = (0..3).map(|j| VirtualBand {
        wavelength_nm: 490.0 + 10.0 * f64::from(j),
        fwhm_nm: 10.0,
        coefficients: vec![0.5, 0.5, 0.25, -0.25],
    });
    let name = "hsi".to_owned();
    let kind = "hyperspectral".to_owned();
    SensorCalibration {
        version: 1,
        sensor_id: "1.2.3".to_owned(),
        size: [20, 10],
        bit_depth: Some(10),
        full_well_electrons: Some(1e4),
        active_area: [2, 1, 16, 8],
        pattern: 2,
        spectral_range_nm: [480.0, 520.0],
        bands: vec![band; 4],
        optical_components: Vec::new(),
        matrices: vec![CorrectionMatrix { name, kind, virtual_bands: rows.collect() }],
    }
}

fn trajectory() -> (geometry::Trajectory, String) {
    let poses: Vec<Pose> = (0..10).map(|i| Pose::translation(f64::from(i), 0.5, -1e-3)).collect();
    let trajectory = numbered(&poses, 100_000_000);
    let kitti = kitti_from_trajectory(&trajectory);
    (trajectory, kitti)
}

fn mcap() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    let about = BTreeMap::from([("run".to_owned(), "sample".to_owned())]);
    let mut writer = RecordingWriter::create(&path, &about, &[ByteTable::of::<ClassTopic>()]).expect("creates");
    for tick in 0..4 {
        writer.tick("class", &TickRow { tick, ..TickRow::default() }).expect("writes");
    }
    writer.finish().expect("finishes");
    fs::read(path).expect("reads")
}

/// A state file, and the states that the target decodes without a file.
fn states() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("stage.state");
    let runner = RunnerState {
        tick: 7,
        barrier: 3,
        drive_begin: Some(-5),
        counters: BTreeMap::from([("lost".to_owned(), 2)]),
        notes: vec!["a note".to_owned()],
        ..RunnerState::default()
    };
    let stage = [3; 40];
    write_state(&path, &runner, std::iter::once(run::Piece::plain(&stage)), &[])
        .expect("writes")
        .commit()
        .expect("saves");
    let position = drive::SourcePosition::Clouds { next: 4, taken: 2, n_bad: 1 };
    vec![
        fs::read(path).expect("reads"),
        encode_state(2, &runner).expect("encodes"),
        encode_state(2, &position).expect("encodes"),
    ]
}

/// Two images in parts.
fn multipart() -> Vec<u8> {
    let part = |image: Vec<u8>| {
        let header = format!("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", image.len());
        [header.into_bytes(), image, b"\r\n".to_vec()].concat()
    };
    [part(picture(ImageFormat::Png)), part(pgm_from_samples(20, 10, 255, &[77; 200]))].concat()
}

const CHECK_POINTS: &str = "name,x,y,z,cloud_x,cloud_y,cloud_z\nA,448251.5,5411932.25,36.1,448251.51,5411932.24,36.12\n# one that was not found\nB,448260,5411940,36.3,,,\n";

/// 3 rows of 4 columns around 48 degrees north, 2 degrees east; one node without value.
fn geoid_grid() -> Vec<u8> {
    let doubles = [47.0_f64, 1.0, 0.5, 0.5].into_iter().flat_map(f64::to_be_bytes);
    let sizes = [3_i32, 4].into_iter().flat_map(i32::to_be_bytes);
    let values = (0..12_u8).map(|i| if i == 5 { -88.8888 } else { 44.0 + f32::from(i) }).flat_map(f32::to_be_bytes);
    doubles.chain(sizes).chain(values).collect()
}

/// Shifts in 2 rows of 3 columns from latitude 45 to 60, longitude 0 to 30, and in 2 rows of 2 columns inside.
fn datum_grid() -> Vec<u8> {
    let count = |name: &str, value: i32| [format!("{name:8}").as_bytes(), &value.to_le_bytes(), &[0; 4]].concat();
    let number = |name: &str, value: f64| [format!("{name:8}").as_bytes(), &(value * 3600.0).to_le_bytes()].concat();
    let word = |name: &str, value: &str| format!("{name:8}{value:8}").into_bytes();
    let mut records =
        vec![count("NUM_OREC", 11), count("NUM_SREC", 11), count("NUM_FILE", 2), word("GS_TYPE", "SECONDS")];
    records.extend(
        ["VERSION", "SYSTEM_F", "SYSTEM_T", "MAJOR_F", "MINOR_F", "MAJOR_T", "MINOR_T"].map(|name| word(name, "")),
    );
    for (name, parent, [south, north, east, west], n) in
        [("COARSE", "NONE", [45.0, 60.0, -30.0, 0.0], 6_u8), ("FINE", "COARSE", [45.0, 60.0, -15.0, 0.0], 4)]
    {
        records.extend([word("SUB_NAME", name), word("PARENT", parent), word("CREATED", ""), word("UPDATED", "")]);
        records.extend([
            number("S_LAT", south),
            number("N_LAT", north),
            number("E_LONG", east),
            number("W_LONG", west),
        ]);
        records.extend([number("LAT_INC", 15.0), number("LONG_INC", 15.0), count("GS_COUNT", i32::from(n))]);
        records.extend(
            (0..n).map(|i| [3.0 + f32::from(i), -2.0, 0.1, 0.1].into_iter().flat_map(f32::to_le_bytes).collect()),
        );
    }
    records.concat()
}
