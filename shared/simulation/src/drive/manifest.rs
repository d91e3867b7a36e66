//! `drive.toml` of a simulated drive.

use super::mosaic_models;
use crate::rig;
use crate::sensors::gnss::ORIGIN;
use crate::sensors::mosaic::{BIT_DEPTH, EXPOSURE_NANOS, SIZE, WHITE_EXPOSURE_NANOS, WHITE_REFLECTANCE};
use crate::spec::DriveSpec;
use formats::manifest::{
    CameraEntry, GnssEntry, ImuEntry, LidarEntry, MANIFEST_VERSION, Manifest, MosaicEntry, TruthEntry,
};

pub fn manifest(spec: &DriveSpec) -> Manifest {
    Manifest {
        version: MANIFEST_VERSION,
        name: format!("simulated {} drive, seed {}, {} s", spec.town.name(), spec.seed, spec.seconds),
        lidar: LidarEntry {
            model: "hdl32e".into(),
            format: "pcap".into(),
            folder: "lidar".into(),
            body_from_lidar: rig::body_from_lidar().into(),
        },
        cameras: if spec.cameras { cameras() } else { Vec::new() },
        mosaics: if spec.mosaics { mosaics() } else { Vec::new() },
        gnss: Some(GnssEntry { file: "gnss.nmea".into(), origin: ORIGIN, antenna_in_body: rig::ANTENNA_IN_BODY }),
        imu: Some(ImuEntry { file: "imu.csv".into() }),
        truth: Some(TruthEntry { trajectory: "truth/trajectory.txt".into(), labels: "truth/labels".into() }),
    }
}

fn cameras() -> Vec<CameraEntry> {
    rig::color_cameras()
        .into_iter()
        .enumerate()
        .map(|(index, (name, body_from_camera))| CameraEntry {
            name,
            folder: format!("camera/{index}"),
            exposure_nanos: rig::CAMERA_EXPOSURE_NANOS,
            body_from_camera: body_from_camera.into(),
            model: rig::color_lens(),
        })
        .collect()
}

fn mosaics() -> Vec<MosaicEntry> {
    mosaic_models()
        .into_iter()
        .zip(rig::mosaic_mountings())
        .map(|(model, body_from_camera)| MosaicEntry {
            name: model.name.into(),
            folder: model.name.into(),
            exposure_nanos: EXPOSURE_NANOS,
            dark_exposure_nanos: EXPOSURE_NANOS,
            white_exposure_nanos: WHITE_EXPOSURE_NANOS,
            white_reflectance: f64::from((WHITE_REFLECTANCE * 100.0).round()) / 100.0,
            bit_depth: BIT_DEPTH,
            pattern: model.pattern as u32,
            active_area: model.active_area.map(|v| v as u32),
            wavelengths_nm: model.bands().iter().map(|band| f64::from(band.center_nm)).collect(),
            body_from_camera: body_from_camera.into(),
            model: rig::mosaic_lens(),
        })
        .inspect(|entry| debug_assert!(entry.active_area[0] + entry.active_area[2] <= SIZE[0] as u32))
        .collect()
}
