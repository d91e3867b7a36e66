//! Real captures of every supported sensor.

use crate::support::{open, sweeps};
use geometry::Stamp;
use lidar::SweepPoint;
use lidar::nmea::{Sentence, parse};
use lidar::pcap::PacketReader;
use lidar::velodyne::{Model, PositionPacket};
use nalgebra::{Matrix3, Vector3};

fn range_m(found: &SweepPoint) -> f32 {
    (found.x * found.x + found.y * found.y + found.z * found.z).sqrt()
}

fn elevation_deg(found: &SweepPoint) -> f32 {
    found.z.atan2(found.x.hypot(found.y)).to_degrees()
}

#[real_data::test("velodyne/vlp16_moving_car.pcap")]
fn real_vlp16_capture_decodes_to_plausible_sweeps() {
    let path = real_data::path("velodyne/vlp16_moving_car.pcap");
    let mut reader = open(&path);
    assert_eq!(reader.model(), Model::Vlp16.into());
    let sweeps = sweeps(&mut reader);
    let stats = reader.stats();
    assert_eq!((stats.data_packets, stats.position_packets, stats.cut_captures), (291, 56, 1));
    assert!(!stats.has_lost_data());
    assert_eq!(sweeps.len(), 5);
    for (info, returns) in &sweeps[1..4] {
        assert!((i64::from(info.duration_nanos) - 100_000_000).abs() < 500_000);
        // 300 000 shots a second, three quarters of which come back in a street.
        assert!((20_000..30_000).contains(&returns.len()));
        for found in returns {
            assert!(found.ring < 16 && (0.3..131.1).contains(&range_m(found)));
            // Two degrees from ring to ring; the beams' offsets matter at short range.
            let nominal = f32::from(found.ring) * 2.0 - 15.0;
            assert!((elevation_deg(found) - nominal).abs() < 0.02 + 0.7 / range_m(found), "{found:?}");
        }
        // Times rise with the shots.
        assert!(returns.windows(2).all(|pair| pair[0].offset_nanos < pair[1].offset_nanos));
    }
    // GNSS time: 21:41:06 UTC of 2015-07-23. The first packet is stamped 41:07.108343.
    let first = Stamp(1_437_687_667_108_343_000);
    assert_eq!(sweeps[0].0.stamp, first);
}

#[real_data::test("velodyne/vlp16_moving_car.pcap")]
fn real_position_packets_contain_sentences() {
    let path = real_data::path("velodyne/vlp16_moving_car.pcap");
    let mut reader = PacketReader::open(&path).expect("opens");
    let mut n = 0;
    while let Some(packet) = reader.next().expect("reads") {
        let Some(position) = PositionPacket::new(packet.payload) else { continue };
        let Ok(Sentence::Rmc(rmc)) = parse(position.nmea) else { panic!("{:?}", position.nmea) };
        // The car is in California; capture and satellites agree within two seconds.
        let [latitude, longitude] = rmc.position_deg.expect("has one");
        assert!((latitude - 37.13).abs() < 0.01 && (longitude + 121.65).abs() < 0.01);
        assert!(packet.stamp.seconds_since(rmc.stamp.expect("has one")).abs() < 2.0);
        n += 1;
    }
    assert_eq!(n, 56);
}

#[real_data::test("velodyne/hdl64e.pcap")]
fn real_hdl64e_capture_decodes_to_plausible_sweeps() {
    let path = real_data::path("velodyne/hdl64e.pcap");
    let mut reader = open(&path);
    assert_eq!(reader.model(), Model::Hdl64e.into());
    let sweeps = sweeps(&mut reader);
    let (info, returns) = &sweeps[1];
    // This early device sends no time, so the clock of the capture is used.
    assert_eq!(reader.stats().data_packets, 306);
    assert!(!reader.stats().has_lost_data());
    assert!((i64::from(info.duration_nanos) - 101_000_000).abs() < 3_000_000, "{info:?}");
    assert_eq!(info.stamp.0 / 1_000_000_000, 1_404_833_944);
    assert!((80_000..110_000).contains(&returns.len()));
    let mut by_ring = [0; 64];
    for found in returns {
        by_ring[usize::from(found.ring)] += 1;
        assert!((0.5..135.0).contains(&range_m(found)), "{found:?}");
    }
    // Upper lasers fire three times as often as lower ones.
    let lower: usize = by_ring[..32].iter().sum();
    let upper: usize = by_ring[32..].iter().sum();
    assert!(upper > lower && by_ring.iter().filter(|n| **n > 100).count() >= 60, "{by_ring:?}");
    // Each laser has its own angles and offsets; with them the road is one plane. This table belongs to another device, so
    // residuals of some centimetres remain; without distance corrections of 1.2 m there would be no plane at all.
    let near = |found: &&SweepPoint| (5.0..12.0).contains(&found.x.hypot(found.y)) && found.z < -1.3;
    let road: Vec<Vector3<f64>> =
        returns.iter().filter(near).map(|found| Vector3::new(found.x, found.y, found.z).cast()).collect();
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for p in &road {
        let row = Vector3::new(1.0, p.x, p.y);
        normal += row * row.transpose();
        right += row * p.z;
    }
    let plane = normal.try_inverse().expect("points all around") * right;
    let mut off: Vec<f64> = road.iter().map(|p| (p.z - plane.dot(&Vector3::new(1.0, p.x, p.y))).abs()).collect();
    off.sort_by(f64::total_cmp);
    let median = off[off.len() / 2];
    assert!(road.len() > 10_000 && median < 0.08 && (plane[0] + 2.0).abs() < 0.3, "{}: {median} {plane}", road.len());
}
