//! Decoded packets of every lidar model compared with the scene.

use geometry::{Isometry3, Point3};
use lidar::pcap::Writer;
use lidar::velodyne::{DATA_PORT, Model};
use lidar::{SweepPoint, SweepReader};
use nalgebra::Translation3;
use simulation::sensors::lidar::LidarModel;
use simulation::{DriveSpec, Simulation};

#[test]
fn decoded_points_of_every_lidar_model_match_hits() {
    let simulation = Simulation::new(&DriveSpec::urban(3, 0.2).sparse(1)).expect("a town");
    let folder = tempfile::tempdir().expect("a folder");
    // Upright on the roof.
    let body_from_lidar = Isometry3::from(Translation3::new(0.0, 0.0, 1.2));
    for model in Model::ALL {
        let lidar = simulation.lidar_of(LidarModel::for_model(model), body_from_lidar, 1);
        let path = folder.path().join(model.name());
        let mut capture = Writer::new(std::fs::File::create(&path).expect("a file")).expect("writes");
        let mut expected = Vec::new();
        // Some hundredths of a second, during which the vehicle is stationary.
        for (packet, blocks) in (0..40).zip(lidar.packets(0..40)) {
            let stamp = lidar.packet_stamp(packet);
            capture.write_udp(stamp, DATA_PORT, &lidar.payload(packet, &blocks)).expect("writes");
            let found = blocks.iter().flat_map(|block| &block.returns);
            for (slot, (found, ray)) in found.zip(lidar.rays(packet)).enumerate() {
                let laser = slot % 32 % model.n_rings() + if blocks[slot / 32].is_lower { 32 } else { 0 };
                let Some(found) = found else { continue };
                let range_m = f32::from(found.range_2mm) * 0.002 + model.lasers()[laser].range_m as f32;
                let nanos = lidar.packet_stamp(packet).0 + i64::from(model.firing_nanos(slot / 32, slot % 32));
                expected.push((ray.at(range_m), nanos, found.intensity, (found.range_m - range_m).abs()));
            }
        }
        capture.finish().expect("writes");
        let mut reader = SweepReader::open(vec![path], None).expect("a capture");
        assert_eq!(reader.model(), model.into(), "known by its packets");
        let mut decoded: Vec<SweepPoint> = Vec::new();
        let info = reader.next_sweep(|some| decoded.extend_from_slice(some)).expect("sound").expect("a sweep");
        assert_eq!((decoded.len(), info.lost_packets), (expected.len(), 0), "{model:?}");
        assert!(decoded.len() > 40 * 384 / 2, "{model:?}: {}", decoded.len());
        let world_from_lidar = simulation.motion.pose(0.0) * body_from_lidar;
        for (found, (point, nanos, intensity, noise)) in decoded.iter().zip(&expected) {
            let at = world_from_lidar * Point3::new(found.x, found.y, found.z).cast::<f64>();
            let range_m = f64::from(found.x).hypot(f64::from(found.y)).hypot(f64::from(found.z));
            // Encoder error: three sigmas and the truncated count.
            let off = (at.coords - point.cast::<f64>()).norm();
            assert!(off < 0.006 + 5e-4 * range_m, "{model:?} {off} m at {range_m} m");
            assert!(*noise < 4.0 * LidarModel::for_model(model).optics.range_sigma_m, "{noise}");
            assert_eq!(found.intensity, *intensity);
            // Both halves of an HDL-64E fire simultaneously; packets resolve microseconds.
            let late = info.stamp.0 + i64::from(found.offset_nanos) - nanos;
            let slack = if model == Model::Hdl64e { 28_800 } else { 0 };
            assert!((-slack - 2000..2000).contains(&late), "{model:?} {late} ns");
        }
    }
}
