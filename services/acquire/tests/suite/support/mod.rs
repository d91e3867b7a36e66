//! A small hand-made drive with every kind of sensor.

use drive::imu::{ImuSample, csv_from_samples};
use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, LidarEntry, Manifest, MosaicEntry, PoseEntry};
use formats::pgm::pgm_from_samples;
use geometry::{CameraModel, Pinhole, Stamp};
use lidar::nmea::{Fix, gga_from_fix, rmc_from_fix};
use lidar::pcap::Writer;
use lidar::velodyne::{DATA_PORT, Model, RawBlock, RawReturn, encode_data_packet};
use std::fs;
use std::path::Path;

/// Two seconds before a full hour.
pub const BEGIN: Stamp = Stamp(1_699_999_200_000_000_000 - 2_000_000_000);
/// Columns and rows of all cameras.
pub const SIZE: [u32; 2] = [20, 10];
/// Packets of 4.2 s.
pub const N_PACKETS: i64 = 7600;

/// The range of every shot of a round, in 2 mm.
pub fn range_2mm(round: i64) -> u16 {
    2000 + (round % 1000) as u16
}

/// Value of a color image's first pixel.
pub fn red(stamp: Stamp, camera: usize) -> u8 {
    ((stamp.0 / 100_000_000) % 200) as u8 + camera as u8
}

/// Packets for which `keep` holds.
pub fn write_lidar(folder: &Path, keep: impl Fn(i64) -> bool) {
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for packet in (0..N_PACKETS).filter(|packet| keep(*packet)) {
        let blocks = std::array::from_fn(|index| {
            let round = packet * 12 + index as i64;
            let azimuth = ((round as f64 * 46_080e-9 * 10.0).fract() * 36_000.0) as u16;
            RawBlock {
                azimuth,
                is_lower: false,
                returns: [RawReturn { range_2mm: range_2mm(round), intensity: 50 }; 32],
            }
        });
        let stamp = BEGIN.plus_nanos(packet * 552_960);
        writer.write_udp(stamp, DATA_PORT, &encode_data_packet(Model::Hdl32e, stamp, &blocks)).expect("writes");
    }
    fs::create_dir_all(folder.join("lidar")).expect("makes");
    fs::write(folder.join("lidar/0.pcap"), writer.finish().expect("writes")).expect("writes");
}

/// A drive of 4.2 s at 5 m/s: two color cameras and a mosaic at 1 Hz from 0.25 s on, GNSS at 1 Hz, IMU at 100 Hz.
pub fn write_drive(folder: &Path) {
    write_lidar(folder, |_| true);
    let stamps = [0.25, 1.25, 2.25, 3.25].map(|s| BEGIN.plus_nanos((s * 1e9) as i64));
    for camera in 0..2 {
        fs::create_dir_all(folder.join(format!("camera/{camera}"))).expect("makes");
        for stamp in stamps {
            let mut image = image::RgbImage::new(SIZE[0], SIZE[1]);
            image.put_pixel(0, 0, image::Rgb([red(stamp, camera), 2, 3]));
            image.save(folder.join(format!("camera/{camera}/{}.png", stamp.0))).expect("writes");
        }
    }
    fs::create_dir_all(folder.join("hs03")).expect("makes");
    for (k, stamp) in stamps.iter().enumerate() {
        let samples: Vec<u16> = (0..200).map(|i| i + k as u16).collect();
        fs::write(folder.join(format!("hs03/{}.pgm", stamp.0)), pgm_from_samples(SIZE[0], SIZE[1], 1023, &samples))
            .expect("writes");
    }
    let fixes: Vec<String> =
        (0..5).map(fix).flat_map(|fix| [gga_from_fix(&fix, 44.6), rmc_from_fix(&fix), String::new()]).collect();
    fs::write(folder.join("gnss.nmea"), fixes.join("\r\n")).expect("writes");
    // From half a second before the first sweep on.
    let samples: Vec<ImuSample> = (-50..450).map(sample).collect();
    fs::write(folder.join("imu.csv"), csv_from_samples(&samples)).expect("writes");
    fs::write(folder.join("drive.toml"), toml::to_string(&manifest()).expect("encodes")).expect("writes");
}

pub fn fix(second: i64) -> Fix {
    Fix {
        stamp: BEGIN.plus_nanos(second * 1_000_000_000),
        position_deg: [48.8, 2.3 + second as f64 * 6.82e-5],
        altitude_m: Some(104.0),
        speed_mps: Some(5.0),
        course_deg: Some(90.0),
        hdop: Some(0.9),
        satellites: 8,
        quality: 4,
        vdop: None,
        deviation: None,
    }
}

pub fn sample(number: i64) -> ImuSample {
    ImuSample {
        stamp: BEGIN.plus_nanos(number * 10_000_000),
        acceleration: [0.0, 0.1, 9.81],
        angular_rate: [number as f64 * 0.1, 0.0, 0.0],
    }
}

fn manifest() -> Manifest {
    let [width, height] = SIZE;
    let model =
        CameraModel::Pinhole(Pinhole { width, height, fx: 10.0, fy: 10.0, cx: 9.5, cy: 4.5, distortion: [0.0; 5] });
    let camera = |index: usize| CameraEntry {
        delay_nanos: 0,
        name: format!("camera {index}"),
        folder: format!("camera/{index}"),
        exposure_nanos: 2_000_000,
        body_from_camera: PoseEntry::IDENTITY,
        model: model.clone(),
    };
    let lidar = LidarEntry::from_captures("hdl32e", PoseEntry::IDENTITY);
    Manifest {
        cameras: vec![camera(0), camera(1)],
        mosaics: vec![MosaicEntry {
            name: "hs03".into(),
            folder: "hs03".into(),
            sensor: None,
            exposure_nanos: 5_000_000,
            delay_nanos: 0,
            dark_exposure_nanos: 5_000_000,
            white_exposure_nanos: 5_000_000,
            white_reflectance: 0.98,
            white_panel: None,
            bit_depth: 10,
            pattern: 4,
            active_area: [0, 0, 20, 8],
            wavelengths_nm: (0..16).map(|k| 470.0 + 10.0 * f64::from(k)).collect(),
            body_from_camera: PoseEntry::IDENTITY,
            model: model.clone(),
        }],
        gnss: Some(GnssEntry {
            delay_nanos: 0,
            file: "gnss.nmea".into(),
            origin: [48.8, 2.3, 100.0],
            antenna_in_body: [0.0; 3],
            geoid_m: None,
        }),
        imu: Some(ImuEntry { delay_nanos: 0, file: "imu.csv".into(), position_in_body: [0.0; 3], body_from_imu: None }),
        ..Manifest::with_lidar("made by hand", lidar)
    }
}
