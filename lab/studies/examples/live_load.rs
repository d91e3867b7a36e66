//! Receives a sensor until it is silent and prints the load:
//! `cargo run --release -p studies --example live_load -- OUTPUT [PORT]`, then `replica send CAPTURE --to 127.0.0.1:PORT`
//! in another terminal. Position packets are expected at 8308.

use acquire::{Acquire, Settings};
use messages::{GnssTopic, SweepTopic};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Mode};
use std::path::Path;

/// CPU time of the thread of that name, s; the kernel counts in hundredths of a second.
fn cpu_s(name: &str) -> Option<f64> {
    for task in std::fs::read_dir("/proc/self/task").ok()?.flatten() {
        let stat = std::fs::read_to_string(task.path().join("stat")).ok()?;
        let (head, rest) = stat.split_once(')')?;
        if head.ends_with(name) {
            let ticks = rest.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
            return Some(ticks.sum::<f64>() / 100.0);
        }
    }
    None
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let output = arguments.next().ok_or("usage: live_load OUTPUT [PORT]")?;
    let port = arguments.next().unwrap_or_else(|| "2368".to_owned());
    let settings = Settings { listen: format!("127.0.0.1:{port}"), quiet_s: 2.0, ..Settings::default() };
    let context =
        Context { mode: Mode::Live, drive: Path::new(&output).join("nothing"), ..context(Path::new(&output)) };
    let mut bench = Bench::<Acquire>::new(&settings, &context)?;
    let mut n_sweeps = 0;
    let mut n_points = 0;
    let mut n_fixes = 0;
    let mut of_thread = 0.0;
    while bench.tick()? == Flow::Continue {
        for sweep in bench.take::<SweepTopic>() {
            n_sweeps += 1;
            n_points += sweep.rows().len();
        }
        n_fixes += bench.take::<GnssTopic>().iter().map(|message| message.rows().len()).sum::<usize>();
        of_thread = cpu_s("receiver").unwrap_or(of_thread);
    }
    println!("{n_sweeps} sweeps, {n_points} points, {n_fixes} fixes; receiving thread {of_thread:.2} s of CPU");
    let counters =
        ["udp_packets", "udp_packets_dropped", "data_packets", "position_packets", "lost_packets", "clock_jumps"];
    for name in counters.into_iter().chain(["sweeps_skipped", "partial_sweeps"]) {
        println!("{name} {}", bench.counter(name));
    }
    for note in bench.notes() {
        println!("{note}");
    }
    Ok(())
}
