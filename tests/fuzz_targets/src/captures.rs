//! Captures, packets and the logs of receivers.

use crate::accepted::accepted;
use crate::scratch::with_file;
use drive::imu::ImuReader;
use lidar::SweepReader;
use lidar::pcap::PacketReader;
use lidar::velodyne::{DATA_PACKET_BYTES, DataPacket, Decoder, Model, PositionPacket};

/// All packets and all sweeps of a capture.
pub(crate) fn capture(bytes: &[u8]) {
    with_file("a.pcap", bytes, |path| {
        if let Ok(mut reader) = PacketReader::open(path) {
            while let Ok(Some(packet)) = reader.next() {
                assert!(packet.payload.len() <= bytes.len());
            }
        }
        let opened = SweepReader::open(vec![path.to_owned()], None);
        accepted(&opened);
        let Ok(mut reader) = opened else { return };
        let mut n_sweeps = 0;
        while let Ok(Some(sweep)) = reader.next_sweep(|_| {}) {
            assert!(sweep.n_returns <= SweepReader::MAX_RETURNS);
            n_sweeps += 1;
            if n_sweeps == 1 {
                let position = reader.position();
                assert!(reader.resume(&position).is_ok(), "a reader can resume where it stands");
            }
        }
        assert!(n_sweeps <= bytes.len() / 100, "{n_sweeps} sweeps");
    });
}

/// Packets without headers, one after the other.
fn packets(model: Model, bytes: &[u8]) {
    let decoder = Decoder::new(model);
    let mut returns = Vec::new();
    for payload in bytes.chunks(DATA_PACKET_BYTES) {
        if let Some(packet) = DataPacket::new(payload) {
            returns.clear();
            decoder.decode_into(packet, 0..12, 0, &mut returns);
            let is_valid = |one: &lidar::SweepPoint| {
                one.x.is_finite() && one.azimuth < 36_000 && usize::from(one.ring) < model.n_rings()
            };
            assert!(returns.iter().all(is_valid));
            let _ = (Model::from_packet(packet), model.may_have_sent(packet), packet.return_mode(), packet.azimuth(11));
        }
        for length in [512, payload.len()] {
            if let Some(packet) = payload.get(..length).and_then(PositionPacket::new) {
                let _ = lidar::nmea::parse(packet.nmea);
            }
        }
    }
}

pub(crate) fn hdl32e(bytes: &[u8]) {
    packets(Model::Hdl32e, bytes);
}

pub(crate) fn vlp16(bytes: &[u8]) {
    packets(Model::Vlp16, bytes);
}

pub(crate) fn vlp32c(bytes: &[u8]) {
    packets(Model::Vlp32c, bytes);
}

pub(crate) fn hdl64e(bytes: &[u8]) {
    packets(Model::Hdl64e, bytes);
}

pub(crate) fn nmea(bytes: &[u8]) {
    let (fixes, _) = lidar::nmea::fixes(bytes);
    assert!(fixes.iter().all(|fix| fix.position_deg[0].abs() <= 90.0 && fix.position_deg[1].abs() <= 180.0));
}

pub(crate) fn imu(bytes: &[u8]) {
    let samples: Vec<_> = ImuReader::new(bytes).filter_map(Result::ok).collect();
    assert!(samples.windows(2).all(|pair| pair[0].stamp < pair[1].stamp));
    assert!(samples.iter().flat_map(|sample| sample.acceleration).all(f64::is_finite));
}
