//! `truth/visibility` against the pictures' own geometry.

#[allow(dead_code, reason = "every test uses its part")]
mod support;

use formats::velodyne::{Model, SweepReader};
use geometry::{Point3, Stamp};
use simulation::trace::Ray;
use simulation::{DriveSpec, Simulation, write_drive};

/// Masks of a file: stamps of the exposures, and by return one byte for each.
fn parse(bytes: &[u8]) -> (Vec<i64>, Vec<&[u8]>) {
    assert_eq!(&bytes[..8], b"REPLVIS1");
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")) as usize;
    let (n_exposures, n_returns) = (number(8), number(12));
    let stamps = bytes[16..16 + 8 * n_exposures].as_chunks::<8>().0.iter().map(|b| i64::from_le_bytes(*b)).collect();
    let masks: Vec<&[u8]> = bytes[16 + 8 * n_exposures..].chunks_exact(n_exposures).collect();
    assert_eq!(masks.len(), n_returns);
    (stamps, masks)
}

#[test]
fn a_return_is_seen_where_nothing_is_between_it_and_the_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drive");
    let spec = DriveSpec { truth_visibility: true, ..DriveSpec::urban(3, 3.4).sparse(12) };
    write_drive(&spec, &drive, &mut |_| ()).expect("a drive");
    let simulation = Simulation::new(&spec).expect("a town");
    let mut reader = SweepReader::open(vec![drive.join("lidar/000000.pcap")], Some(Model::Hdl32e)).expect("a capture");
    let (mut seen, mut all, mut hidden, mut wrong) = (0_u32, 0_u32, 0_u32, 0_u32);
    for seq in 0..30 {
        let mut returns = Vec::new();
        let sweep = reader.next_sweep(|some| returns.extend_from_slice(some)).expect("sound").expect("a sweep");
        let bytes = std::fs::read(drive.join(format!("truth/visibility/{seq:06}.visibility"))).expect("a file");
        let (stamps, masks) = parse(&bytes);
        assert_eq!(masks.len(), returns.len());
        assert!(stamps.iter().all(|stamp| (stamp - sweep.stamp.0).abs() <= 2_000_000_000));
        if seq != 24 {
            continue;
        }
        assert_eq!(stamps.len(), 3);
        for (found, masks) in returns.iter().zip(masks) {
            let seconds = sweep.stamp.seconds_since(simulation.motion.begin) + f64::from(found.offset_nanos) * 1e-9;
            let p = simulation.motion.pose(seconds)
                * simulation.rig.lidar.body_from_lidar
                * Point3::new(f64::from(found.x), f64::from(found.y), f64::from(found.z));
            for (stamp, mask) in stamps.iter().zip(masks) {
                let seconds = Stamp(*stamp).seconds_since(simulation.motion.begin);
                for (k, camera) in simulation.rig.cameras.iter().enumerate() {
                    let world_from_camera = simulation.motion.pose(seconds) * camera.body_from_camera;
                    let is_seen = mask >> k & 1 == 1;
                    all += 1;
                    if camera.lens.pixel_from_camera(&(world_from_camera.inverse() * p)).is_none() {
                        assert!(!is_seen, "outside the picture");
                        continue;
                    }
                    let eye = world_from_camera * Point3::origin();
                    let toward = p - eye;
                    let direction = (toward / toward.norm()).cast();
                    let ray = Ray { origin: eye.coords.cast(), direction, seed: 9 };
                    let before = (toward.norm() - 1.0) as f32;
                    if simulation.scene.is_blocked(&simulation.scene.at(seconds), &ray, before.max(0.1)) {
                        hidden += 1;
                        // Through the gaps of leaves a ray may pass or not.
                        wrong += u32::from(is_seen);
                    } else {
                        seen += u32::from(is_seen);
                    }
                }
            }
        }
    }
    assert!(seen > 2000 && hidden > 500 && all > 4 * seen, "{seen} {hidden} {all}");
    assert!(f64::from(wrong) < 0.03 * f64::from(hidden), "{wrong} of {hidden} behind something are seen");
}
