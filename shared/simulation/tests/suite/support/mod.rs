//! A shared drive, and readers of recordings that follow the documents of the manufacturers and not the code under test.

use simulation::{DriveSpec, Simulation, write_drive};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A drive that several tests read.
pub struct SharedDrive {
    pub path: PathBuf,
    pub files: BTreeMap<String, Vec<u8>>,
    pub simulation: Simulation,
}

/// An urban drive of 2.2 s with a sparse lidar and without cameras, simulated once per test run.
pub static SHARED_DRIVE: LazyLock<SharedDrive> = LazyLock::new(|| {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("simulation-shared-drive");
    // Remains of an earlier run.
    let _ = std::fs::remove_dir_all(&path);
    let spec = DriveSpec::urban(4, 2.2).sparse(3);
    write_drive(&spec, &path, &mut |_| ()).expect("a drive");
    SharedDrive { files: files(&path), simulation: Simulation::new(&spec).expect("a town"), path }
});

/// All files of a folder by their path inside it.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(path) = open.pop() {
        for entry in std::fs::read_dir(path).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("inside").to_string_lossy().into_owned();
                found.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    found
}

/// UDP payloads of a classic pcap of Ethernet frames: destination port and bytes.
pub fn udp_payloads(capture: &[u8]) -> Vec<(u16, &[u8])> {
    let u32_at = |at: usize| u32::from_le_bytes(capture[at..at + 4].try_into().expect("4 bytes")) as usize;
    assert_eq!(u32_at(0), 0xa1b2_c3d4, "microseconds, little endian");
    let mut payloads = Vec::new();
    let mut at = 24;
    while at < capture.len() {
        let frame = &capture[at + 16..at + 16 + u32_at(at + 8)];
        let port = u16::from_be_bytes([frame[36], frame[37]]);
        payloads.push((port, &frame[42..]));
        at += 16 + frame.len();
    }
    payloads
}

/// One return of an HDL-32E, in the lidar frame.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// Time after the first firing of the recording, s.
    pub seconds: f64,
    pub direction: [f64; 3],
    pub range_m: f64,
    pub intensity: u8,
}

/// The returns by revolution, from the packets alone.
pub fn revolutions(capture: &[u8]) -> Vec<Vec<Shot>> {
    let mut revolutions = vec![Vec::new()];
    let mut first_micros = None;
    let mut last_azimuth = 0;
    for (_, payload) in udp_payloads(capture).into_iter().filter(|(port, bytes)| *port == 2368 && bytes.len() == 1206) {
        let micros = u32::from_le_bytes(payload[1200..1204].try_into().expect("4 bytes"));
        let since = micros - *first_micros.get_or_insert(micros);
        assert_eq!(payload[1204..], [0x37, 0x21]);
        for (block, bytes) in payload[..1200].chunks_exact(100).enumerate() {
            assert_eq!(bytes[..2], [0xff, 0xee]);
            let azimuth = u16::from_le_bytes([bytes[2], bytes[3]]);
            if azimuth < last_azimuth {
                revolutions.push(Vec::new());
            }
            last_azimuth = azimuth;
            for (laser, bytes) in bytes[4..].chunks_exact(3).enumerate() {
                let range = u16::from_le_bytes([bytes[0], bytes[1]]);
                if range == 0 {
                    continue;
                }
                let late = laser as f64 * 1.152e-6;
                // 10 revolutions per second.
                let azimuth = (f64::from(azimuth) / 100.0 + 3600.0 * late).to_radians();
                let elevation = if laser % 2 == 0 { -92.0 / 3.0 } else { -28.0 / 3.0 } + (laser / 2) as f64 * 4.0 / 3.0;
                let (sin_e, cos_e) = elevation.to_radians().sin_cos();
                revolutions.last_mut().expect("never empty").push(Shot {
                    seconds: f64::from(since) * 1e-6 + block as f64 * 46.08e-6 + late,
                    direction: [cos_e * azimuth.cos(), -cos_e * azimuth.sin(), sin_e],
                    range_m: f64::from(range) * 0.002,
                    intensity: bytes[2],
                });
            }
        }
    }
    revolutions
}
