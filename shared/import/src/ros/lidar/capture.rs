//! Packets of a bag as a capture.

use crate::error::{At, ImportError};
use geometry::Stamp;
use lidar::pcap::Writer;
use lidar::{Model, SweepReader};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Name of the capture in the LiDAR folder.
const NAME: &str = "packets.pcap";

/// Writes a capture.
pub(crate) struct Capture {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    /// UDP port in the capture; bags do not contain it.
    port: u16,
    pub n_packets: u64,
}

impl Capture {
    pub fn create(folder: &Path, port: u16) -> Result<Self, ImportError> {
        let path = folder.join(NAME);
        let file = BufWriter::new(File::create(&path).at(&path)?);
        let writer = Writer::new(file).at(&path)?;
        Ok(Self { path, writer, port, n_packets: 0 })
    }

    pub fn add(&mut self, stamp: i64, packet: &[u8]) -> Result<(), String> {
        self.n_packets += 1;
        self.writer.write_udp(Stamp(stamp), self.port, packet).map_err(|error| error.to_string())
    }

    /// Detects the model from the packets, unless it is given.
    pub fn finish(self, model: Option<Model>) -> Result<Model, ImportError> {
        self.writer.finish().at(&self.path)?;
        match model {
            Some(model) => Ok(model),
            None => SweepReader::open(vec![self.path.clone()], None).map(|reader| reader.model()).map_err(|error| {
                ImportError::for_option("--model", format!("the packets do not name a supported LiDAR: {error}"))
            }),
        }
    }
}
