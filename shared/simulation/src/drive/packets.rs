//! TEMPORARY: bytes of packets and captures.

use crate::sensors::lidar::{Block, N_BLOCKS};
use geometry::Stamp;
use std::io::{self, Write};

pub fn write_header(out: &mut impl Write) -> io::Result<()> {
    let mut head = Vec::new();
    head.extend(0xa1b2_c3d4_u32.to_le_bytes());
    head.extend(2_u16.to_le_bytes());
    head.extend(4_u16.to_le_bytes());
    head.extend([0; 8]);
    head.extend(65535_u32.to_le_bytes());
    head.extend(1_u32.to_le_bytes());
    out.write_all(&head)
}

fn udp(out: &mut impl Write, stamp: Stamp, port: u16, payload: &[u8]) -> io::Result<()> {
    let n = payload.len() + 42;
    let mut f = Vec::with_capacity(n + 16);
    let us = stamp.0 / 1000;
    f.extend(((us / 1_000_000) as u32).to_le_bytes());
    f.extend(((us % 1_000_000) as u32).to_le_bytes());
    f.extend((n as u32).to_le_bytes());
    f.extend((n as u32).to_le_bytes());
    f.extend([0xff; 6]);
    f.extend([0x60, 0x76, 0x88, 0, 0, 1, 8, 0]);
    f.extend([0x45, 0]);
    f.extend((payload.len() as u16 + 28).to_be_bytes());
    f.extend([0, 0, 0, 0, 64, 17, 0, 0, 192, 168, 1, 201, 255, 255, 255, 255]);
    f.extend(port.to_be_bytes());
    f.extend(port.to_be_bytes());
    f.extend((payload.len() as u16 + 8).to_be_bytes());
    f.extend([0, 0]);
    f.extend(payload);
    out.write_all(&f)
}

fn hour_micros(stamp: Stamp) -> u32 {
    (stamp.0.rem_euclid(3_600_000_000_000) / 1000) as u32
}

pub fn write_data(out: &mut impl Write, stamp: Stamp, blocks: &[Block; N_BLOCKS]) -> io::Result<()> {
    let mut p = Vec::with_capacity(1206);
    for b in blocks {
        p.extend([0xff, 0xee]);
        p.extend(b.azimuth.to_le_bytes());
        for r in &b.returns {
            p.extend(r.map_or(0, |r| r.range_2mm).to_le_bytes());
            p.push(r.map_or(0, |r| r.intensity));
        }
    }
    p.extend(hour_micros(stamp).to_le_bytes());
    p.extend([0x37, 0x21]);
    udp(out, stamp, 2368, &p)
}

pub fn write_position(out: &mut impl Write, stamp: Stamp, rmc: &str) -> io::Result<()> {
    let mut p = vec![0; 512];
    p[198..202].copy_from_slice(&hour_micros(stamp).to_le_bytes());
    p[206..206 + rmc.len()].copy_from_slice(rmc.as_bytes());
    p[206 + rmc.len()] = b'\r';
    p[207 + rmc.len()] = b'\n';
    udp(out, stamp, 8308, &p)
}
