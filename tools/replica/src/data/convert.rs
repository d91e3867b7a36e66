//! `replica convert`: converts a packet capture to one point cloud per revolution.

use anyhow::Context;
use clap::ValueEnum;
use command_line::argument::InvalidValue;
use command_line::{exit_code, say, say_error};
use files::text_file::{MAX_CALIBRATION_BYTES, read_text};
use formats::ply::{Header, Kind, PlyWriter};
use lidar::{Lidar, LidarStats, Model, SweepInfo, SweepPoint, SweepReader};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Convert a packet capture to one point cloud per revolution.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done, but the capture has lost or damaged packets\n\n\
                  Example: replica convert capture.pcap clouds"
)]
pub struct Args {
    /// Capture of a LiDAR (pcap or pcapng)
    capture: PathBuf,
    /// Folder for the clouds; created if absent
    out: PathBuf,
    /// Sensor model, as in drive.toml [default: the one that the packets name]
    #[arg(long, value_parser = model)]
    model: Option<Model>,
    /// Calibration file of the unit, for --model: db.xml or YAML of a Velodyne, angle CSV of a Hesai or Robosense, metadata JSON of an
    /// Ouster
    #[arg(long, requires = "model")]
    calibration: Option<PathBuf>,
    /// File format of the clouds
    #[arg(long, value_enum, default_value_t = Format::Ply)]
    format: Format,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Binary little-endian PLY: x y z (m, lidar frame: x forward, y left, z up), intensity, ring, azimuth (deg, clockwise),
    /// time (s since the Unix epoch)
    Ply,
}

fn model(name: &str) -> Result<Model, InvalidValue> {
    Model::from_name(name).ok_or(InvalidValue("the name of a model in docs/reference/drive_folder.md"))
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let lidar = match (args.model, &args.calibration) {
        (Some(model), Some(path)) => {
            let text = read_text(path, MAX_CALIBRATION_BYTES).with_context(|| path.display().to_string())?;
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            Some(Lidar::with_calibration(model, &name, text).with_context(|| path.display().to_string())?)
        }
        (model, _) => model.map(Lidar::from),
    };
    let mut reader = SweepReader::open(vec![args.capture.clone()], lidar.as_ref())?;
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let stem = args.capture.file_stem().unwrap_or_default().to_string_lossy().into_owned();

    say!("{} of {}", args.capture.display(), reader.model().name())?;
    say!("revolution    points  turn deg       ms  lost  file")?;
    let mut returns = Vec::new();
    let mut n_points = 0;
    while let Some(info) = reader.next_sweep(|piece| returns.extend_from_slice(piece))? {
        let Format::Ply = args.format;
        let path = args.out.join(format!("{stem}_{:06}.ply", info.seq));
        write_ply(&path, &info, reader.model(), &returns)?;
        say!(
            "{:10} {:9} {:9.1} {:8.2} {:5}  {}",
            info.seq,
            info.n_returns,
            info.turn * 360.0,
            f64::from(info.duration_nanos) * 1e-6,
            info.lost_packets,
            path.display()
        )?;
        n_points += info.n_returns;
        returns.clear();
    }
    let stats = reader.stats();
    print_counts(n_points, &stats)?;
    for damage in reader.damage() {
        say_error!("warning: {damage}");
    }
    Ok(if stats.has_lost_data() { ExitCode::from(exit_code::INCOMPLETE) } else { ExitCode::SUCCESS })
}

fn print_counts(n_points: usize, stats: &LidarStats) -> std::io::Result<()> {
    say!("points {n_points}")?;
    for (name, n) in stats.counts() {
        if n > 0 {
            say!("{name} {n}")?;
        }
    }
    Ok(())
}

fn write_ply(path: &Path, info: &SweepInfo, model: Model, returns: &[SweepPoint]) -> anyhow::Result<()> {
    let header = Header::new([
        ("x", Kind::Float),
        ("y", Kind::Float),
        ("z", Kind::Float),
        ("intensity", Kind::UChar),
        ("ring", Kind::UChar),
        ("azimuth", Kind::Float),
        ("time", Kind::Double),
    ])
    .comment(format!("{} revolution {}", model.name(), info.seq))
    .info("frame lidar")
    .info(format!("stamp_nanos {}", info.stamp.0));
    let mut writer = PlyWriter::create(path, &header, returns.len())?;
    writer.write_each(returns.len(), |i, row| {
        let found = &returns[i];
        // A double resolves 0.24 µs at current times; lasers fire 1.15 µs apart.
        let time = info.stamp.plus_nanos(i64::from(found.offset_nanos)).0 as f64 * 1e-9;
        row.f32(found.x).f32(found.y).f32(found.z).u8(found.intensity).u8(found.ring);
        row.f32(f32::from(found.azimuth) * 0.01).f64(time);
    })?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::Vertices;
    use geometry::Stamp;
    use lidar::velodyne::{DATA_PORT, Model, RawBlock, RawReturn, encode_data_packet};

    /// Two packets of one azimuth sector, and the packet between them if `complete`.
    fn capture(folder: &Path, complete: bool) -> PathBuf {
        let mut writer = lidar::pcap::Writer::new(Vec::new()).expect("writes");
        for packet in [0_i64, 1, 2] {
            let blocks = std::array::from_fn(|index| RawBlock {
                azimuth: 9000 + (packet as u16 * 12 + index as u16) * 18,
                is_lower: false,
                returns: [RawReturn { range_2mm: 2500, intensity: packet as u8 }; 32],
            });
            let stamp = Stamp(1_700_000_000_000_000_000 + packet * 552_960);
            if complete || packet != 1 {
                writer.write_udp(stamp, DATA_PORT, &encode_data_packet(Model::Hdl32e, stamp, &blocks)).expect("writes");
            }
        }
        let path = folder.join("drive.pcap");
        std::fs::write(&path, writer.finish().expect("writes")).expect("writes");
        path
    }

    #[test]
    fn lost_packet_gives_fewer_points_and_exit_code_3() {
        let folder = tempfile::tempdir().expect("a folder");
        for (complete, code, n_points) in
            [(true, ExitCode::SUCCESS, 1152), (false, ExitCode::from(exit_code::INCOMPLETE), 768)]
        {
            let out = folder.path().join("out");
            let args = Args {
                capture: capture(folder.path(), complete),
                out: out.clone(),
                model: None,
                calibration: None,
                format: Format::Ply,
            };
            assert_eq!(run(&args).expect("converts"), code);
            let cloud = Vertices::load(&out.join("drive_000000.ply")).expect("loads");
            let [y, azimuth] = ["y", "azimuth"].map(|name| cloud.f32s(name).expect("is there"));
            assert_eq!(y.len(), n_points);
            // The first laser points to the right and 30.67 degrees down.
            let expected = -5.0 * 30.67_f32.to_radians().cos();
            assert!((azimuth[0] - 90.0).abs() < 1e-4 && (y[0] - expected).abs() < 1e-4, "{} {}", azimuth[0], y[0]);
        }
    }
}
