//! What finished runs cost, and what a campaign of many such drives on a cluster with failures takes.
//!
//! `campaign OUT DRIVES MACHINES` reads the runs in the folder OUT and prints two tables: kilometres, hours, memory and disk of each run, and the
//! simulated campaign in several situations. [`cluster`] lists what the simulation assumes.

mod cluster;
mod costs;

use cluster::{Cluster, Ending, Restart, simulate};
use costs::{RunCosts, mean};
use std::path::Path;

const HOUR_S: f64 = 3600.0;
const DAY_S: f64 = 24.0 * HOUR_S;

/// A situation of the campaign.
struct Situation {
    name: &'static str,
    cluster: Cluster,
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [out, drives, machines] = arguments.as_slice() else { anyhow::bail!("usage: campaign OUT DRIVES MACHINES") };
    let runs = costs::read(Path::new(out))?;
    print_costs(&runs);
    // A drive of a survey: as many metres for each second as the runs, but a work shift of 40 minutes.
    let drive = mean(&runs).scaled_to(2400.0);
    println!(
        "\na drive of {:.0} min: {:.1} km, {:.2} machine hours, {:.1} GB read, {:.1} GB written",
        drive.drive_s / 60.0,
        drive.km,
        drive.wall_s / HOUR_S,
        drive.read_bytes * 1e-9,
        drive.disk_bytes * 1e-9
    );
    println!(
        "| situation | hours | machine hours | repeated, % | failures | drives that failed |\n|---|---|---|---|---|---|"
    );
    let (n_drives, n_machines) = (drives.parse()?, machines.parse()?);
    for Situation { name, cluster } in situations(n_machines) {
        let Ending { hours, machine_hours, repeated_share, n_failures, n_failed_drives } =
            simulate(&cluster, &drive, n_drives);
        println!(
            "| {name} | {hours:.1} | {machine_hours:.0} | {:.2} | {n_failures} | {n_failed_drives} |",
            100.0 * repeated_share
        );
    }
    Ok(())
}

fn situations(n_machines: usize) -> Vec<Situation> {
    let sound = Cluster { n_machines, ..Cluster::default() };
    let months = Cluster { mean_time_to_failure_s: 30.0 * DAY_S, ..sound };
    let spot = Cluster { mean_time_to_failure_s: 4.0 * HOUR_S, repair_s: 600.0, ..sound };
    [
        ("no failures", sound),
        ("each machine fails once in 30 days", months),
        ("spot machines: preempted every 4 h", spot),
        ("the same, without barriers", Cluster { restart: Restart::FromBeginning, ..spot }),
        ("1 in 100 drives faulty, three attempts", Cluster { faulty_share: 0.01, ..months }),
        ("a shared disk of 2 GB/s", Cluster { disk_bytes_per_s: 2e9, ..months }),
        ("a shared disk of 0.5 GB/s", Cluster { disk_bytes_per_s: 0.5e9, ..months }),
        ("a shared disk of 1 Gbit/s", Cluster { disk_bytes_per_s: 0.125e9, ..months }),
    ]
    .map(|(name, cluster)| Situation { name, cluster })
    .into()
}

fn print_costs(runs: &[RunCosts]) {
    println!(
        "| run | km | drive s | machine s | processor s | memory MB | read MB | written MB | files | machine h per 100 km |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let all = RunCosts { name: "mean".to_owned(), ..mean(runs) };
    for run in runs.iter().chain(std::iter::once(&all)) {
        println!(
            "| {} | {:.3} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} | {:.0} | {:.1} |",
            run.name,
            run.km,
            run.drive_s,
            run.wall_s,
            run.cpu_s,
            run.memory_bytes * 1e-6,
            run.read_bytes * 1e-6,
            run.disk_bytes * 1e-6,
            run.n_files,
            100.0 * run.wall_s / HOUR_S / run.km.max(f64::MIN_POSITIVE)
        );
    }
}
