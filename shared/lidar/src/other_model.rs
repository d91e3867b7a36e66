//! Finds out from the first packets of a recording that another model than expected recorded it.

use super::{Lidar, Model};
use crate::pcap::{PacketReader, PcapError};
use std::fmt;
use std::path::PathBuf;

/// Data packets that are examined: a fifth of a second of an HDL-32E.
const MAX_DATA_PACKETS: usize = 400;
/// UDP packets that are examined to find these data packets.
const MAX_PACKETS: usize = 4096;

/// A recording whose packets name another model than the expected one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherModel {
    /// The capture.
    pub file: PathBuf,
    /// Number of the first such UDP packet in the capture, from 1.
    pub packet: usize,
    /// The property of the packet that identifies the model.
    pub evidence: String,
    /// The model that the packet names.
    pub found: Model,
    /// The model that was expected.
    pub expected: Model,
}

impl OtherModel {
    /// `None` if the first data packets may come from the `expected` model, or if the recording has no data packets.
    /// Packets of a second sensor do not matter if some come from the first.
    pub fn find(files: &[PathBuf], lidar: &Lidar) -> Result<Option<Self>, PcapError> {
        let expected = lidar.model();
        let mut first = None;
        let mut n_data = 0;
        let mut n_others = 0;
        let mut n_packets = 0;
        for file in files {
            let mut reader = PacketReader::open(file)?;
            let mut packet = 0;
            while let Some(udp) = reader.next()? {
                packet += 1;
                n_packets += 1;
                if n_packets > MAX_PACKETS || n_data == MAX_DATA_PACKETS {
                    break;
                }
                if !lidar.may_come_from(udp.source, udp.port) {
                    continue;
                }
                if lidar.unit.is_sure_sender(udp.payload) {
                    return Ok(None);
                }
                n_data += usize::from(Model::is_data(udp.payload));
                let Some(found) = Model::from_payload(udp.payload) else { continue };
                n_others += 1;
                first.get_or_insert_with(|| {
                    let evidence = found.maker().evidence(udp.payload);
                    Self { file: file.clone(), packet, evidence, found, expected }
                });
            }
        }
        // An HDL-64E sends a status instead of the factory byte. The status sometimes equals the factory byte of another
        // model.
        Ok(first.filter(|_| 2 * n_others > n_data))
    }
}

impl fmt::Display for OtherModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, packet, evidence, found, expected } = self;
        let found = found.name();
        let expected = expected.name();
        write!(f, "{}: packet {packet}: {evidence}, ", file.display())?;
        write!(f, "drive.toml says {expected:?}; set lidar.model = {found:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pcap::Writer;
    use crate::velodyne::{DATA_PORT, Model, RawBlock, RawReturn, encode_data_packet};
    use geometry::Stamp;

    fn capture(folder: &std::path::Path, models: &[Model]) -> PathBuf {
        let mut writer = Writer::new(Vec::new()).expect("writes");
        writer.write_udp(Stamp(0), 5, b"of something else").expect("writes");
        let returns = [RawReturn { range_2mm: 2000, intensity: 1 }; 32];
        for (number, model) in models.iter().enumerate() {
            let stamp = Stamp(number as i64 * 1_000_000);
            let blocks = std::array::from_fn(|index| {
                let is_lower = *model == Model::Hdl64e && index % 2 == 1;
                RawBlock { azimuth: index as u16, is_lower, returns }
            });
            writer.write_udp(stamp, DATA_PORT, &encode_data_packet(*model, stamp, &blocks)).expect("writes");
        }
        let path = folder.join("a.pcap");
        std::fs::write(&path, writer.finish().expect("writes")).expect("writes");
        path
    }

    #[test]
    fn capture_of_another_model_is_found_with_its_first_packet() {
        let folder = tempfile::tempdir().expect("a folder");
        for sent in Model::ALL {
            let file = capture(folder.path(), &[sent; 20]);
            for expected in Model::ALL {
                let found = OtherModel::find(std::slice::from_ref(&file), &expected.into()).expect("reads");
                assert_eq!(
                    found.as_ref().map(|other| (other.found, other.packet)),
                    (sent != expected).then_some((sent.into(), 2))
                );
            }
        }
        let file = capture(folder.path(), &[Model::Hdl32e; 3]);
        let other =
            OtherModel::find(std::slice::from_ref(&file), &Model::Vlp16.into()).expect("reads").expect("another model");
        let expected = "a.pcap: packet 2: factory byte 0x21 names the HDL-32E, drive.toml says \"vlp16\"; \
                        set lidar.model = \"hdl32e\"";
        assert!(other.to_string().ends_with(expected), "{other}");
    }

    #[test]
    fn packets_of_a_second_sensor_do_not_matter() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = capture(folder.path(), &[Model::Hdl32e, Model::Hdl32e, Model::Vlp16, Model::Hdl32e]);
        for expected in [Model::Vlp16, Model::Hdl32e] {
            assert_eq!(OtherModel::find(std::slice::from_ref(&file), &expected.into()).expect("reads"), None);
        }
    }
}
