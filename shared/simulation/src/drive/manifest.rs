//! `drive.toml` of a simulated drive: nominal mountings and file names.

use crate::rig::{CameraSpec, MosaicSpec, OtherLidarSpec};
use crate::sensors::gnss::ORIGIN;
use crate::sensors::mosaic::{BIT_DEPTH, WHITE_EXPOSURE_NANOS, WHITE_REFLECTANCE};
use crate::spec::DriveSpec;
use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, LidarEntry, Manifest, MosaicEntry, TruthEntry};

pub const GNSS_FILE: &str = "gnss.nmea";
pub const IMU_FILE: &str = "imu.csv";
pub const TRAJECTORY_FILE: &str = "truth/trajectory.txt";
pub const CALIBRATION_FILE: &str = "truth/calibration.toml";
pub const LIDAR_ERRORS_FILE: &str = "truth/lidar_errors.csv";
pub const GNSS_TRUTH_FILE: &str = "truth/gnss.csv";

pub fn manifest(spec: &DriveSpec) -> Manifest {
    let rig = &spec.rig;
    let gnss = rig.gnss.map(|gnss| GnssEntry {
        delay_nanos: 0,
        file: GNSS_FILE.into(),
        origin: [ORIGIN.latitude_deg, ORIGIN.longitude_deg, ORIGIN.altitude_m],
        antenna_in_body: gnss.antenna_in_body,
        geoid_m: None,
    });
    let pass = if spec.pass == 0 { String::new() } else { format!(" pass {},", spec.pass) };
    let name = format!("simulated {} drive, seed {},{pass} {} s", spec.town, spec.seed, spec.seconds);
    let lidar = LidarEntry {
        name: rig.lidar_name.clone(),
        ..LidarEntry::from_captures(rig.lidar.model.name(), rig.lidar.body_from_lidar.into())
    };
    Manifest {
        other_lidars: rig.other_lidars.iter().map(other_lidar).collect(),
        cameras: if spec.cameras {
            (0..).zip(&rig.cameras).map(|(index, spec)| camera(index, spec)).collect()
        } else {
            Vec::new()
        },
        mosaics: if spec.mosaics {
            rig.mosaics.iter().map(|entry| mosaic(entry, spec.mosaic_exposure_nanos)).collect()
        } else {
            Vec::new()
        },
        truth: Some(TruthEntry {
            trajectory: TRAJECTORY_FILE.into(),
            labels: Some("truth/labels".into()),
            calibration: Some(CALIBRATION_FILE.into()),
            gnss: gnss.as_ref().map(|_| GNSS_TRUTH_FILE.into()),
        }),
        gnss,
        imu: rig.imu.map(|imu| ImuEntry {
            delay_nanos: 0,
            file: IMU_FILE.into(),
            position_in_body: imu.position_in_body,
            body_from_imu: None,
        }),
        ..Manifest::with_lidar(&name, lidar)
    }
}

/// Folder of an additional LiDAR.
pub fn lidar_folder(name: &str) -> String {
    format!("lidar_{name}")
}

fn other_lidar(OtherLidarSpec { name, lidar }: &OtherLidarSpec) -> LidarEntry {
    let folder = lidar_folder(name);
    LidarEntry {
        name: Some(name.clone()),
        ..LidarEntry::new(lidar.model.name(), "pcap", &folder, lidar.body_from_lidar.into())
    }
}

fn camera(index: usize, camera: &CameraSpec) -> CameraEntry {
    CameraEntry {
        delay_nanos: 0,
        name: camera.name.clone(),
        folder: format!("camera/{index}"),
        exposure_nanos: camera.exposure_nanos,
        body_from_camera: camera.body_from_camera.into(),
        model: camera.lens.clone(),
    }
}

fn mosaic(mosaic: &MosaicSpec, exposure_nanos: u64) -> MosaicEntry {
    let sensor = &mosaic.sensor;
    MosaicEntry {
        name: mosaic.name.clone(),
        folder: mosaic.name.clone(),
        sensor: Some(format!("{}/sensor.xml", mosaic.name)),
        exposure_nanos,
        delay_nanos: 0,
        dark_exposure_nanos: exposure_nanos,
        white_exposure_nanos: WHITE_EXPOSURE_NANOS,
        white_reflectance: f64::from((WHITE_REFLECTANCE * 100.0).round()) / 100.0,
        white_panel: None,
        bit_depth: BIT_DEPTH,
        pattern: sensor.pattern as u32,
        active_area: sensor.active_area.map(|v| v as u32),
        wavelengths_nm: sensor.bands().iter().map(|band| (f64::from(band.center_nm) * 10.0).round() / 10.0).collect(),
        body_from_camera: mosaic.body_from_camera.into(),
        model: mosaic.lens.clone(),
    }
}
