//! Packets and calibration files of LiDAR sensors other than Velodyne.

use crate::accepted::accepted;
use lidar::{Lidar, Model, PacketDecoder};
use std::cell::RefCell;

/// Metadata of an Ouster with two beams and this profile.
const METADATA: &str = r#"{"beam_altitude_angles": [10, -10], "beam_azimuth_angles": [2, -2], "lidar_mode": "512x10",
    "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1], "udp_profile_lidar": "PROFILE"}"#;
const PROFILES: [&str; 4] = ["LEGACY", "RNG15_RFL8_NIR8", "RNG19_RFL8_SIG16_NIR16", "RNG19_RFL8_SIG16_NIR16_DUAL"];

fn decoders_by_name(names: &[&str]) -> Vec<PacketDecoder> {
    let lidars = names.iter().filter_map(|name| Model::from_name(name)).map(Lidar::from);
    lidars.map(|lidar| PacketDecoder::new(&lidar)).collect()
}

fn with_angles(name: &str, n_beams: usize) -> Option<PacketDecoder> {
    let angles = (0..n_beams).fold(String::new(), |text, beam| text + &format!("{beam},0\n"));
    let lidar = Lidar::with_calibration(Model::from_name(name)?, "angle.csv", angles).ok()?;
    Some(PacketDecoder::new(&lidar))
}

/// Decodes an input as one packet.
fn packet(decoders: &mut [PacketDecoder], bytes: &[u8]) {
    let _ = (Model::from_payload(bytes), Model::may_be_data(bytes));
    for decoder in decoders {
        let mut returns = Vec::new();
        decoder.decode_into(bytes, &mut returns);
        let n_rings = decoder.n_rings().max(1);
        assert!(returns.iter().all(|one| one.azimuth < 36_000 && usize::from(one.ring) < n_rings));
        assert!(returns.iter().all(|one| (one.x + one.y + one.z).is_finite()));
    }
}

pub(crate) fn hesai(bytes: &[u8]) {
    thread_local!(static DECODERS: RefCell<Vec<PacketDecoder>> =
        RefCell::new(decoders_by_name(&["pandar40p", "pandarxt32", "pandarqt64"])));
    DECODERS.with_borrow_mut(|decoders| packet(decoders, bytes));
}

pub(crate) fn ouster(bytes: &[u8]) {
    thread_local!(static DECODERS: RefCell<Vec<PacketDecoder>> = RefCell::new(PROFILES.iter().filter_map(|profile| {
        let text = METADATA.replace("PROFILE", profile);
        Lidar::with_calibration(Model::Ouster, "a.json", text).ok().map(|lidar| PacketDecoder::new(&lidar))
    }).collect()));
    DECODERS.with_borrow_mut(|decoders| packet(decoders, bytes));
}

pub(crate) fn robosense(bytes: &[u8]) {
    thread_local!(static DECODERS: RefCell<Vec<PacketDecoder>> =
        RefCell::new(decoders_by_name(&["rs16"]).into_iter().chain(with_angles("rs32", 32)).collect()));
    for name in ["rs16", "rs32"] {
        let lidar = Model::from_name(name).map(Lidar::from);
        if let Some(calibrated) = lidar.and_then(|lidar| lidar.with_device_packet(bytes)) {
            assert!(calibrated.rings().len() == calibrated.n_rings());
        }
    }
    DECODERS.with_borrow_mut(|decoders| packet(decoders, bytes));
}

pub(crate) fn livox(bytes: &[u8]) {
    thread_local!(static DECODERS: RefCell<Vec<PacketDecoder>> = RefCell::new(decoders_by_name(&["mid360", "avia"])));
    DECODERS.with_borrow_mut(|decoders| packet(decoders, bytes));
}

/// A calibration file of these models.
fn calibration(names: &[&str], bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    for model in names.iter().filter_map(|name| Model::from_name(name)) {
        let read = Lidar::with_calibration(model, "a", text.to_owned());
        accepted(&read);
        if let Ok(lidar) = read {
            assert!(lidar.elevations_deg().iter().all(|elevation| elevation.abs() <= 180.0));
            assert_eq!(lidar.rings().len(), lidar.n_rings());
            let _ = PacketDecoder::new(&lidar);
        }
    }
}

pub(crate) fn ouster_metadata(bytes: &[u8]) {
    calibration(&["ouster"], bytes);
}

pub(crate) fn hesai_angles(bytes: &[u8]) {
    calibration(&["pandar40p", "pandarxt32", "pandarqt64"], bytes);
}

pub(crate) fn robosense_angles(bytes: &[u8]) {
    calibration(&["rs16", "rs32"], bytes);
}

/// Reads `db.xml` and YAML.
pub(crate) fn velodyne_calibration(bytes: &[u8]) {
    calibration(&["vlp16", "vlp32c", "hdl32e", "hdl64e"], bytes);
}
