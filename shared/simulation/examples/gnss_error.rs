//! How far the positions of each receiver are off over a drive through a town, as a picture.
//!
//! `cargo run --release -p simulation --example gnss_error -- SECONDS SEED OUT.svg`

use simulation::sensors::gnss::{Epoch, Receiver};
use simulation::{DriveSpec, Simulation};
use std::error::Error;
use std::fmt::Write;

/// Size of the picture and the height of each of its two charts, px.
const WIDTH: f64 = 900.0;
const CHART: f64 = 170.0;
const LEFT: f64 = 60.0;

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
    let most = logs.iter().flat_map(|(_, epochs)| epochs).filter_map(across).fold(1.0, f64::max).ceil();
    let n = logs[0].1.len();
    let x = |i: usize| LEFT + (WIDTH - LEFT - 20.0) * i as f64 / (n - 1).max(1) as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        2.0 * CHART + 110.0
    );
    chart(&mut svg, 30.0, most, "horizontal error, m");
    let y = |error: f64| 30.0 + CHART * (1.0 - error / most);
    for ((receiver, epochs), (color, left)) in logs.iter().zip([("#b03030", 240.0), ("#308050", 400.0)]) {
        let _ = writeln!(svg, "<text x=\"{left}\" y=\"22\" fill=\"{color}\">{}</text>", receiver.name());
        // A line breaks where there is no position.
        for run in epochs.iter().enumerate().collect::<Vec<_>>().split(|(_, epoch)| epoch.error.is_none()) {
            let point = |(i, epoch): &(usize, &Epoch)| Some(format!("{:.1},{:.1}", x(*i), y(across(epoch)?)));
            let points: Vec<String> = run.iter().filter_map(point).collect();
            let points = points.join(" ");
            let _ =
                writeln!(svg, "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"/>");
        }
    }
    let top = 30.0 + CHART + 40.0;
    chart(&mut svg, top, 20.0, "satellites: in sight (blue), used though heard by a wall alone (orange)");
    let epochs = &logs[0].1;
    let bar = (x(1) - x(0)).max(1.0);
    for (i, epoch) in epochs.iter().enumerate() {
        for (n, color) in [(epoch.n_in_sight, "#4070b0"), (epoch.n_reflected, "#e0902a")] {
            let high = CHART * f64::from(n.min(20)) / 20.0;
            let (left, up) = (x(i) - 0.5 * bar, top + CHART - high);
            let _ = writeln!(
                svg,
                "<rect x=\"{left:.1}\" y=\"{up:.1}\" width=\"{bar:.2}\" height=\"{high:.1}\" fill=\"{color}\"/>"
            );
        }
    }
    let bottom = top + CHART;
    for i in (0..n).step_by((n / 10).max(1)) {
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{i} s</text>", x(i), bottom + 18.0);
    }
    svg + "</svg>\n"
}

/// Frame, title and scale of a chart.
fn chart(svg: &mut String, top: f64, most: f64, title: &str) {
    let right = WIDTH - 20.0;
    let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"{}\">{title}</text>", top - 8.0);
    for part in 0..=4 {
        let share = f64::from(part) / 4.0;
        let y = top + CHART * (1.0 - share);
        let _ = writeln!(
            svg,
            "<line x1=\"{LEFT}\" y1=\"{y}\" x2=\"{right}\" y2=\"{y}\" stroke=\"#d0d0d0\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            y + 4.0,
            share * most
        );
    }
}
