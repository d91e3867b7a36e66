//! Statistics of a simulated HDL-32E compared with a real one.

use geometry::Isometry3;
use lidar::pcap::{PacketReader, Writer};
use lidar::velodyne::{DATA_PORT, DataPacket, Model};
use lidar::{SweepPoint, SweepReader};
use nalgebra::Translation3;
use simulation::sensors::lidar::LidarModel;
use simulation::{DriveSpec, Simulation};
use std::path::Path;

/// Height of the sensor above the road in the capture, m: its lowest ring meets the ground 9.3 m away.
const HEIGHT_M: f64 = 4.76;
/// Rotation rate of the sensor in the capture.
const TURNS_PER_SECOND: f64 = 10.93;

struct Revolution {
    returns: Vec<SweepPoint>,
    /// Share of firings with a return.
    share: f64,
    /// Mean and standard deviation of the encoder's steps, 0.01 degrees.
    steps: [f64; 2],
}

fn read(path: &Path) -> Revolution {
    let mut reader = SweepReader::open(vec![path.to_owned()], Some(&Model::Hdl32e.into())).expect("a capture");
    reader.next_sweep(|_| ()).expect("sound");
    let mut returns = Vec::new();
    let info = reader.next_sweep(|some| returns.extend_from_slice(some)).expect("sound").expect("a whole revolution");
    let mut packets = PacketReader::open(path).expect("a capture");
    let mut azimuths: Vec<u32> = Vec::new();
    // A real capture ends within a packet.
    while let Ok(Some(packet)) = packets.next() {
        let data = DataPacket::new(packet.payload);
        azimuths.extend(data.iter().flat_map(|data| (0..12).filter_map(|block| data.azimuth(block).map(u32::from))));
    }
    let steps: Vec<f64> = azimuths.windows(2).map(|pair| f64::from((pair[1] + 36_000 - pair[0]) % 36_000)).collect();
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    let variance = steps.iter().map(|step| (step - mean).powi(2)).sum::<f64>() / steps.len() as f64;
    let firings = f64::from(info.duration_nanos) / 46_080.0 * 32.0;
    Revolution { share: returns.len() as f64 / firings, returns, steps: [mean, variance.sqrt()] }
}

fn quantile(sweep: &Revolution, value: impl Fn(&SweepPoint) -> f32, share: f64) -> f32 {
    let mut values: Vec<f32> = sweep.returns.iter().map(value).collect();
    values.sort_by(f32::total_cmp);
    values[(share * (values.len() - 1) as f64) as usize]
}

#[real_data::test("velodyne/hdl32e_outdoor.pcap")]
fn simulated_revolution_matches_statistics_of_real_one() {
    let real = read(&real_data::path("velodyne/hdl32e_outdoor.pcap"));
    let simulation = Simulation::new(&DriveSpec::urban(1, 6.0).sparse(1)).expect("a town");
    let model = LidarModel { turns_per_second: TURNS_PER_SECOND, ..LidarModel::HDL32E };
    // The body frame is a metre above the road.
    let body_from_lidar = Isometry3::from(Translation3::new(0.0, 0.0, HEIGHT_M - 1.0));
    let lidar = simulation.lidar_of(model, body_from_lidar, 1);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("simulated.pcap");
    let mut capture = Writer::new(std::fs::File::create(&path).expect("a file")).expect("writes");
    let packets = 8000..8000 + model.n_packets(3.0 / TURNS_PER_SECOND);
    for (packet, blocks) in packets.clone().zip(lidar.packets(packets)) {
        capture.write_udp(lidar.packet_stamp(packet), DATA_PORT, &lidar.payload(packet, &blocks)).expect("writes");
    }
    capture.finish().expect("writes");
    let simulated = read(&path);

    println!("returns {}, share {:.4} (real {:.4})", simulated.returns.len(), simulated.share, real.share);
    // The real sensor was in the open, where a quarter of the firings hit the sky; a street has houses.
    assert!((0.74..0.77).contains(&real.share), "{}", real.share);
    assert!((real.share - 0.1..0.97).contains(&simulated.share), "{}", simulated.share);
    let n = simulated.returns.len();
    assert!((42_000..62_000).contains(&n), "{n}");
    // All lower rings hit the ground.
    let lower = |sweep: &Revolution| sweep.returns.iter().filter(|found| found.ring < 8).count() as f64;
    assert!(lower(&simulated) > 0.9 * lower(&real));
    let range = |found: &SweepPoint| found.x.hypot(found.y).hypot(found.z);
    let intensity = |found: &SweepPoint| f32::from(found.intensity);
    for (share, factor) in [(0.5, 2.0), (0.95, 2.0)] {
        let [a, b] = [&real, &simulated].map(|sweep| quantile(sweep, range, share));
        println!("range at quantile {share}: simulated {b:.2} m, real {a:.2} m");
        assert!((1.0 / factor..factor).contains(&(b / a)), "range at {share}: {a} {b} m");
    }
    assert!(quantile(&simulated, range, 0.99) < 105.0 && quantile(&simulated, range, 0.0) > 0.9);
    // Facades are brighter than the road that fills the real sweep; little of either is a reflector.
    let bright = |sweep: &Revolution| sweep.returns.iter().filter(|found| found.intensity > 100).count() as f64;
    for sweep in [&real, &simulated] {
        assert!((2.0..45.0).contains(&quantile(sweep, intensity, 0.5)));
        assert!(bright(sweep) > 0.0 && bright(sweep) < 0.02 * sweep.returns.len() as f64);
    }
    let [real, simulated] = [real.steps, simulated.steps];
    assert!((real[0] - simulated[0]).abs() < 0.05 && (real[1] - simulated[1]).abs() < 0.1, "{real:?} {simulated:?}");
}
