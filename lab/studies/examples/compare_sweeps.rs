//! A real and a simulated HDL-32E side by side: `cargo run --release -p studies --example compare_sweeps -- CAPTURE OUT [TOWN [SEED]]`.
//!
//! Reads a capture of an upright HDL-32E, simulates a revolution of one that is mounted as high and turns as fast in the streets of a town
//! (urban), reads that from its packets as well, and writes into the folder OUT
//! - `sweeps.png`: range images, 0.3 degrees a column, a ring in five rows, the upper ring on top. From above: range of the real
//!   and of the simulated sweep (1 m violet to 120 m yellow, by the logarithm), intensity of both (0 black to 100 white, above
//!   that red); no return is dark blue;
//! - `histograms.svg`: ranges, intensities, steps of the encoder; heights are square roots of shares, so that rare things show;
//! - and prints the figures to stdout.

#![allow(missing_docs, reason = "a program")]

use chart::{Axis, Chart, Series};
use image::{Rgb, RgbImage};
use lidar::pcap::{PacketReader, Writer};
use lidar::velodyne::{DATA_PORT, DataPacket, Model};
use lidar::{SweepPoint, SweepReader};
use nalgebra::{Isometry3, Translation3};
use simulation::sensors::lidar::LidarModel;
use simulation::{DriveSpec, Simulation, Town};
use std::error::Error;
use std::path::{Path, PathBuf};

const COLUMNS: u32 = 1200;
const ROWS_PER_RING: u32 = 5;
const N_RINGS: u32 = 32;
/// The body frame's height above the road, m.
const BODY_HEIGHT_M: f64 = 1.0;
/// The revolution begins here in the drive, s.
const BEGIN_SECONDS: u64 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [capture, out, options @ ..] = args.as_slice() else {
        return Err("which CAPTURE, and which folder OUT?".into());
    };
    let town = options.first().map_or(Ok(Town::Urban), |name| name.parse())?;
    let seed = options.get(1).map_or(Ok(1), |seed| seed.parse())?;
    let out = PathBuf::from(out);
    std::fs::create_dir_all(&out)?;
    let real = Recording::read(Path::new(capture))?;
    println!("sensor {:.2} m above the ground, {:.2} turns/s", real.height_m, real.turns_per_second());
    let simulated = out.join("simulated.pcap");
    simulate(&real, town, seed, &simulated)?;
    let simulated = Recording::read(&simulated)?;
    for (name, recording) in [("real", &real), ("simulated", &simulated)] {
        println!(
            "{name}: {} returns in a revolution, {:.1} % of the firings; median range {:.1} m, {:.2} % beyond 100 m; \
             median intensity {}, {:.2} % above 100",
            recording.sweep.len(),
            100.0 * recording.share_of_firings,
            recording.quantile(range, 0.5),
            100.0 * recording.share(|r| range(r) > 100.0),
            recording.quantile(|r| f32::from(r.intensity), 0.5),
            100.0 * recording.share(|r| r.intensity > 100),
        );
    }
    picture(&real, &simulated).save(out.join("sweeps.png"))?;
    std::fs::write(out.join("histograms.svg"), histograms(&real, &simulated))?;
    Ok(())
}

/// A capture's first whole revolution, and the steps of its encoder.
struct Recording {
    sweep: Vec<SweepPoint>,
    share_of_firings: f64,
    steps: Vec<u32>,
    height_m: f64,
}

impl Recording {
    fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let mut reader = SweepReader::open(vec![path.to_owned()], Some(&Model::Hdl32e.into()))?;
        // The first begins somewhere in a turn.
        reader.next_sweep(|_| ())?;
        let mut sweep = Vec::new();
        let info = reader.next_sweep(|some| sweep.extend_from_slice(some))?.ok_or("no whole revolution")?;
        let mut packets = PacketReader::open(path)?;
        let mut azimuths: Vec<u32> = Vec::new();
        while let Some(packet) = packets.next()? {
            let data = DataPacket::new(packet.payload);
            azimuths
                .extend(data.iter().flat_map(|data| (0..12).filter_map(|block| data.azimuth(block).map(u32::from))));
        }
        let steps = azimuths.windows(2).map(|pair| (pair[1] + 36_000 - pair[0]) % 36_000).filter(|step| *step < 100);
        // The lowest ring meets the ground: the height that most of its returns agree on.
        let mut drops: Vec<f32> = sweep.iter().filter(|r| r.ring == 0).map(|r| -r.z).collect();
        drops.sort_by(f32::total_cmp);
        let firings = f64::from(info.duration_nanos) / 46_080.0 * f64::from(N_RINGS);
        Ok(Self {
            share_of_firings: sweep.len() as f64 / firings,
            steps: steps.collect(),
            height_m: f64::from(drops.get(drops.len() / 2).copied().ok_or("the lowest ring sees nothing")?),
            sweep,
        })
    }

    fn turns_per_second(&self) -> f64 {
        let sum: u64 = self.steps.iter().map(|step| u64::from(*step)).sum();
        sum as f64 / self.steps.len() as f64 / 36_000.0 / 46.08e-6
    }

    fn share(&self, is: impl Fn(&SweepPoint) -> bool) -> f64 {
        self.sweep.iter().filter(|found| is(found)).count() as f64 / self.sweep.len() as f64
    }

    fn quantile(&self, value: impl Fn(&SweepPoint) -> f32, share: f64) -> f32 {
        let mut values: Vec<f32> = self.sweep.iter().map(value).collect();
        values.sort_by(f32::total_cmp);
        values[(share * (values.len() - 1) as f64) as usize]
    }
}

fn range(found: &SweepPoint) -> f32 {
    found.x.hypot(found.y).hypot(found.z)
}

/// Three revolutions, of which the reader takes the second.
fn simulate(like: &Recording, town: Town, seed: u64, path: &Path) -> Result<(), Box<dyn Error>> {
    let spec = DriveSpec { town, ..DriveSpec::urban(seed, BEGIN_SECONDS as f64 + 2.0) };
    let simulation = Simulation::new(&spec)?;
    let model = LidarModel { turns_per_second: like.turns_per_second(), ..LidarModel::HDL32E };
    let body_from_lidar = Isometry3::from(Translation3::new(0.0, 0.0, like.height_m - BODY_HEIGHT_M));
    let lidar = simulation.lidar_of(model, body_from_lidar, seed);
    let first = BEGIN_SECONDS * 1_000_000_000 / model.packet_nanos() as u64;
    let mut capture = Writer::new(std::fs::File::create(path)?)?;
    for (packet, blocks) in (first..).zip(lidar.packets(first..first + model.n_packets(3.0 / model.turns_per_second))) {
        capture.write_udp(lidar.packet_stamp(packet), DATA_PORT, &lidar.payload(packet, &blocks))?;
    }
    capture.finish()?;
    Ok(())
}

fn picture(real: &Recording, simulated: &Recording) -> RgbImage {
    let strip = N_RINGS * ROWS_PER_RING;
    let gap = 8;
    let mut image = RgbImage::from_pixel(COLUMNS, 4 * strip + 3 * gap, Rgb([255; 3]));
    let strips = [(real, false), (simulated, false), (real, true), (simulated, true)];
    for (number, (recording, shows_intensity)) in (0..).zip(strips) {
        let top = number * (strip + gap);
        for y in top..top + strip {
            for x in 0..COLUMNS {
                image.put_pixel(x, y, Rgb([12, 14, 40]));
            }
        }
        for found in &recording.sweep {
            // Ahead in the middle of the picture.
            let column = (u32::from(found.azimuth) * COLUMNS / 36_000 + COLUMNS / 2) % COLUMNS;
            let row = top + (N_RINGS - 1 - u32::from(found.ring)) * ROWS_PER_RING;
            let color = if shows_intensity { gray(found.intensity) } else { by_range(range(found)) };
            (0..ROWS_PER_RING).for_each(|y| image.put_pixel(column, row + y, color));
        }
    }
    image
}

fn gray(intensity: u8) -> Rgb<u8> {
    if intensity > 100 {
        return Rgb([255, 70, 50]);
    }
    // Most of a street reflects little: the square root shows it.
    let level = (25.5 * f32::from(intensity).sqrt()) as u8;
    Rgb([level; 3])
}

/// Violet, blue, green, yellow by the logarithm of 1 to 120 m (after the color map viridis).
fn by_range(range_m: f32) -> Rgb<u8> {
    const STOPS: [[f32; 3]; 5] =
        [[110.0, 10.0, 120.0], [70.0, 90.0, 170.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];
    let place = (range_m.max(1.0).ln() / 120.0_f32.ln()).clamp(0.0, 0.999) * (STOPS.len() - 1) as f32;
    let stop = place as usize;
    let share = place.fract();
    Rgb(std::array::from_fn(|c| (STOPS[stop][c] * (1.0 - share) + STOPS[stop + 1][c] * share) as u8))
}

fn histograms(real: &Recording, simulated: &Recording) -> String {
    let both = [real, simulated];
    let ranges = both.map(|r| r.sweep.iter().map(range).collect::<Vec<f32>>());
    let intensities = both.map(|r| r.sweep.iter().map(|found| f32::from(found.intensity)).collect::<Vec<f32>>());
    let steps = both.map(|r| r.steps.iter().map(|step| *step as f32).collect::<Vec<f32>>());
    let charts = [
        histogram("range, m", [0.0, 120.0], 60, &ranges),
        histogram("intensity", [0.0, 256.0], 64, &intensities),
        histogram("step of the encoder, 0.01 degrees", [12.5, 24.5], 12, &steps),
    ];
    chart::sheet(&charts, 3)
}

/// Shares of both in bins: bars of the real, a line of the simulated.
fn histogram(title: &str, [low, high]: [f32; 2], n_bins: usize, values: &[Vec<f32>; 2]) -> Chart {
    let shares = values.each_ref().map(|values| {
        let mut shares = vec![0.0_f32; n_bins];
        for value in values.iter().filter(|value| (low..high).contains(value)) {
            shares[((value - low) / (high - low) * n_bins as f32) as usize] += 1.0 / values.len() as f32;
        }
        shares.iter().map(|share| f64::from(share.sqrt())).collect::<Vec<f64>>()
    });
    let bin = f64::from(high - low) / n_bins as f64;
    let low = f64::from(low);
    let bars = shares[0].iter().enumerate().map(|(i, share)| [low + bin * (i as f64 + 0.5), *share]);
    let edges = |(i, share): (usize, &f64)| [i, i + 1].map(|edge| [low + bin * edge as f64, *share]);
    let line = shares[1].iter().enumerate().flat_map(edges);
    let series = vec![
        Series::bars("real", "#bbb", bars.collect(), bin),
        Series::line("simulated", chart::COLORS[0], line.collect()),
    ];
    let most = shares.iter().flatten().copied().fold(0.0, f64::max);
    let x = Axis::new(title, [low, f64::from(high)]);
    let y = Axis::without_numbers("", [0.0, most]);
    Chart { size: [280.0, 170.0], ..Chart::new("", x, y, series) }
}
