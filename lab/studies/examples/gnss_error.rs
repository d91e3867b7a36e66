//! Position errors of each receiver class over a drive through a town, as a chart.
//!
//! `cargo run --release -p studies --example gnss_error -- SECONDS SEED OUT.svg`

use chart::{Axis, COLORS, Chart, Series};
use simulation::sensors::gnss::{Epoch, Receiver};
use simulation::{DriveSpec, Simulation};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [seconds, seed, out] = &arguments[..] else { return Err("arguments: SECONDS SEED OUT.svg".into()) };
    let mut spec = DriveSpec::urban(seed.parse()?, seconds.parse()?);
    let mut logs = Vec::new();
    for receiver in Receiver::ALL {
        if let Some(gnss) = &mut spec.rig.gnss {
            gnss.receiver = receiver;
        }
        let epochs = Simulation::new(&spec)?.epochs();
        println!("{}: {}", receiver.name(), summary(&epochs));
        logs.push((receiver, epochs));
    }
    std::fs::write(out, picture(&logs))?;
    Ok(())
}

/// Horizontal error of a second, m.
fn across(epoch: &Epoch) -> Option<f64> {
    epoch.error.map(|error| error.xy().norm())
}

fn summary(epochs: &[Epoch]) -> String {
    let mut errors: Vec<f64> = epochs.iter().filter_map(across).collect();
    errors.sort_by(f64::total_cmp);
    let n = errors.len().max(1);
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt();
    let at = |share: f64| errors.get((share * (n - 1) as f64) as usize).copied().unwrap_or(f64::NAN);
    let in_sight = epochs.iter().map(|epoch| f64::from(epoch.n_in_sight)).sum::<f64>() / epochs.len() as f64;
    let without = epochs.iter().filter(|epoch| epoch.fix.is_none()).count();
    format!(
        "{} s: horizontal error {rms:.2} m RMS, {:.2} m median, {:.2} m at 95 %, {:.2} m at most; {in_sight:.1} satellites in sight; \
         {without} s without a position",
        epochs.len(),
        at(0.5),
        at(0.95),
        at(1.0)
    )
}

fn picture(logs: &[(Receiver, Vec<Epoch>)]) -> String {
    let size = [820.0, 170.0];
    let epochs = &logs[0].1;
    let seconds = Axis::new("s", [0.0, epochs.len().saturating_sub(1).max(1) as f64]);
    let most = logs.iter().flat_map(|(_, epochs)| epochs).filter_map(across).fold(1.0, f64::max).ceil();
    let mut lines = Vec::new();
    for ((receiver, epochs), color) in logs.iter().zip([COLORS[1], COLORS[2]]) {
        // A line breaks where there is no position.
        for run in epochs.iter().enumerate().collect::<Vec<_>>().split(|(_, epoch)| epoch.error.is_none()) {
            let points = run.iter().filter_map(|(i, epoch)| Some([*i as f64, across(epoch)?]));
            lines.push(Series::line(receiver.name(), color, points.collect()));
        }
    }
    let errors = Axis::new("m", [0.0, most]);
    let upper = Chart { size, ..Chart::new("Horizontal error", seconds.clone(), errors, lines) };
    let bars = |name: &str, color, n: fn(&Epoch) -> u32| {
        let points = epochs.iter().enumerate().map(|(i, epoch)| [i as f64, f64::from(n(epoch))]);
        Series::bars(name, color, points.collect(), 1.0)
    };
    let bars = vec![
        bars("in sight", COLORS[6], |epoch| epoch.n_in_sight),
        bars("used, received by reflection only", COLORS[4], |epoch| epoch.n_reflected),
    ];
    let lower = Chart { size, ..Chart::new("Satellites", seconds, Axis::new("", [0.0, 20.0]), bars) };
    chart::sheet(&[upper, lower], 1)
}
