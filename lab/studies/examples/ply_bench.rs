//! Writes a cloud as PLY, for the comparison with other libraries in `lab/peers/all.py`: `ply_bench POINTS CLOUD`.
//!
//! POINTS has packed rows in native byte order: x, y, z (f32) and intensity (u8). Each line `run` of stdin writes CLOUD once, without
//! waiting for the disk, and prints the CPU time of all threads, ns.

use formats::ply::{Header, Kind, PlyWriter};
use rustix::time::{ClockId, clock_gettime};
use std::path::PathBuf;

/// Bytes of a row of POINTS.
const ROW: usize = 13;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [points, cloud] = paths.as_slice() else { return Err("usage: ply_bench POINTS CLOUD".into()) };
    let bytes = std::fs::read(points)?;
    let (rows, _) = bytes.as_chunks::<ROW>();
    let axes = ["x", "y", "z"].map(|name| (name, Kind::Float));
    let header = Header::new(axes.into_iter().chain([("intensity", Kind::UChar)]));
    let cpu_nanos = || {
        let time = clock_gettime(ClockId::ProcessCPUTime);
        time.tv_sec * 1_000_000_000 + time.tv_nsec
    };
    // Columns, as in the other libraries.
    let value = |row: &[u8; ROW], at: usize| f32::from_ne_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
    let positions: Vec<[f32; 3]> = rows.iter().map(|row| [0, 4, 8].map(|at| value(row, at))).collect();
    let intensities: Vec<u8> = rows.iter().map(|row| row[12]).collect();
    for line in std::io::stdin().lines() {
        if line? != "run" {
            break;
        }
        let begun = cpu_nanos();
        let mut writer = PlyWriter::create(cloud, &header, rows.len())?;
        writer.write_each(rows.len(), |i, row| {
            let [x, y, z] = positions[i];
            row.f32(x).f32(y).f32(z).u8(intensities[i]);
        })?;
        writer.finish_unsynced()?;
        println!("{}", cpu_nanos() - begun);
    }
    Ok(())
}
