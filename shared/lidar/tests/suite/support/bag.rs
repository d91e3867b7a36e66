//! Captures from ROS 2 bags of packets.

use formats::sqlite::{Database, Value};
use geometry::Stamp;
use lidar::pcap::Writer;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

/// Little-endian CDR.
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cdr<'a> {
    fn take(&mut self, n: usize) -> &'a [u8] {
        self.at += n;
        &self.bytes[self.at - n..self.at]
    }

    fn u32(&mut self) -> u32 {
        self.at = self.at.next_multiple_of(4);
        u32::from_le_bytes(self.take(4).try_into().expect("four bytes"))
    }

    fn stamp(&mut self) -> Stamp {
        let seconds = self.u32();
        let nanos = self.u32();
        Stamp(i64::from(seconds) * 1_000_000_000 + i64::from(nanos))
    }
}

/// Writes the packets of a bag to a capture: of `pandar_msgs/PandarScan`, whose packets have a size, or
/// `velodyne_msgs/VelodyneScan`. With `message`, only the packets of this message.
pub fn capture_of_bag(bag: &Path, capture: &Path, message: Option<usize>) -> PathBuf {
    let is_pandar = bag.to_string_lossy().contains("/40p/")
        || bag.to_string_lossy().contains("/xt32/")
        || bag.to_string_lossy().contains("/qt64/");
    let mut writer = Writer::new(Vec::new()).expect("writes");
    let address = |ip| SocketAddrV4::new(ip, 2368);
    let database = Database::open(bag).expect("a database");
    let mut rows = database.rows("messages").expect("reads").expect("the table");
    for number in 0.. {
        let Some(mut row) = rows.next_row().expect("reads") else { break };
        rows.load(&mut row).expect("reads");
        let Some(Value::Blob(data)) = row.value(3).expect("reads") else { panic!("no message") };
        if message.is_some_and(|message| message != number) {
            continue;
        }
        let mut cdr = Cdr { bytes: &data[4..], at: 0 };
        cdr.stamp();
        let n_name = cdr.u32() as usize;
        cdr.take(n_name);
        for _ in 0..cdr.u32() {
            let stamp = cdr.stamp();
            let payload = if is_pandar {
                let buffer = cdr.take(1500);
                let size = cdr.u32() as usize;
                &buffer[..size]
            } else {
                cdr.take(1206)
            };
            let source = address(Ipv4Addr::new(192, 168, 1, 201));
            writer.write_datagram(stamp, source, address(Ipv4Addr::BROADCAST), payload).expect("writes");
        }
    }
    std::fs::write(capture, writer.finish().expect("writes")).expect("writes");
    capture.to_owned()
}
