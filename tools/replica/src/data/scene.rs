//! `replica scene`: a finished run as the static world of a simulator.

use super::deliver::{open_finished_run, progress_bar};
use super::new_folder::NewFolder;
use command_line::answer::Answer;
use command_line::exit_code::INCOMPLETE;
use command_line::say_error;
use scene::road::Traffic;
use scene::{SceneSummary, write_scene};
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write the street of a run for simulators: ground, objects, roads.
///
/// Moving points and objects that can move are taken out, and the ground that they hid is completed. The folder holds meshes of the ground
/// (glTF, 3D Tiles), the remaining points, the objects, and the road network as ASAM OpenDRIVE.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done, but without roads\n\n\
                        Example: replica scene out/sample --out scene")]
pub struct Args {
    /// Output folder of a finished run with classes
    run: PathBuf,
    /// Folder for the files; created if absent, must be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Vehicles drive on the left side
    #[arg(long)]
    left_hand_traffic: bool,
    #[command(flatten)]
    answer: Answer,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (summary, run) = open_finished_run(&args.run, "scene")?;
    let folder = NewFolder::create(&args.out)?;
    let bar = progress_bar("scene", run.index.clouds.iter().map(|entry| entry.n_points).sum());
    let traffic = if args.left_hand_traffic { Traffic::Left } else { Traffic::Right };
    let scene = write_scene(&run, traffic, &folder.files, |n| bar.inc(n))?;
    bar.finish_and_clear();
    folder.finish()?;
    args.answer.print(&scene, || text(&scene))?;
    for (stage, doubt) in summary.doubts() {
        say_error!("the run is doubtful: [{stage}] {}", doubt.text);
    }
    if scene.roads.roads > 0 {
        return Ok(ExitCode::SUCCESS);
    }
    Ok(ExitCode::from(INCOMPLETE))
}

fn text(scene: &SceneSummary) -> String {
    let mut text = String::new();
    let roads = &scene.roads;
    let fixed: Vec<String> = scene.fixed.iter().map(|(class, n)| format!("{n} {class}")).collect();
    let removed = scene.removed;
    let rows = [
        ("points", format!("{} of the run, {} in the scene", scene.points, scene.static_points)),
        ("removed", format!("{} moving, {} of objects that can move", removed.moving, removed.movable)),
        (
            "ground",
            format!(
                "{:.0} m2 measured, {:.0} m2 completed, {} triangles",
                scene.measured_ground_m2, scene.completed_ground_m2, scene.triangles
            ),
        ),
        (
            "roads",
            format!(
                "{} with {:.0} m, {:.0} m of lanes, {:.0} m of sidewalks, {:.0} m of paint",
                roads.roads, roads.length_m, roads.driving_lanes_m, roads.sidewalks_m, roads.painted_m
            ),
        ),
        ("objects", format!("{} that can move, {} of them moved; {}", scene.movable, scene.moving, fixed.join(", "))),
    ];
    for (name, value) in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:8} {value}");
    }
    for line in &scene.left_out {
        let _ = writeln!(text, "left out: {line}");
    }
    text
}
