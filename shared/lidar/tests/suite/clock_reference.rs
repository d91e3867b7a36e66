//! Clock references reported by real sensors.

use crate::support::{open, sweeps};
use lidar::{Lidar, Model, SweepReader};

#[real_data::test("velodyne/vlp16_moving_car.pcap", "velodyne/hdl32e_outdoor.pcap")]
fn position_packets_of_real_sensors_tell_the_state_of_the_pulse() {
    // A car with a receiver, and a sensor without one.
    for (name, expected) in [("vlp16_moving_car", (56, 0)), ("hdl32e_outdoor", (0, 65))] {
        let mut reader = open(&real_data::path(&format!("velodyne/{name}.pcap")));
        sweeps(&mut reader);
        let stats = reader.stats();
        assert_eq!((stats.clock_locked, stats.clock_unlocked), expected, "{name}");
        assert_eq!(stats.position_packets, stats.clock_locked + stats.clock_unlocked, "{name}");
    }
}

#[real_data::test("lidars/ouster")]
fn metadata_of_a_real_ouster_tells_that_its_clock_is_free_running() {
    let folder = real_data::path("lidars/ouster");
    let text = std::fs::read_to_string(folder.join("same_ports_legacy.1.json")).expect("reads");
    let lidar = Lidar::with_calibration(Model::Ouster, "metadata.json", text).expect("is metadata");
    let mut reader = SweepReader::open(vec![folder.join("same_ports_legacy.pcap")], Some(&lidar)).expect("opens");
    sweeps(&mut reader);
    let stats = reader.stats();
    assert!(stats.data_packets > 0);
    assert_eq!((stats.clock_locked, stats.clock_unlocked), (0, stats.data_packets));
}
