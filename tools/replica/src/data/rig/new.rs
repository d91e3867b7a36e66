//! `replica rig new`: makes a drive.toml.

use super::questions::{Answers, ask, position};
use super::secondary_lidar::{self, SecondaryLidar};
use anyhow::{Context, bail, ensure};
use command_line::answer::Answer;
use drive::MANIFEST_FILE;
use drive::manifest::LidarEntry;
use geometry::{Pose, Translation3, UnitQuaternion};
use lidar::Model;
use rig::rotation;
use rig::source::{self, FrameTree, RigParts, SourceOptions};
use serde::Serialize;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Make a drive.toml by questions, or from a calibration of another program.
///
/// A source is a tf tree (`ros2 topic echo /tf_static > tf.yaml`), a folder of KITTI calibrations, `calibrated_sensor.json` of nuScenes,
/// the .cal of a Ladybug, a camchain of Kalibr, or the YAML of OpenCV or of a `camera_info`. On a terminal, asks for missing
/// values.
#[derive(clap::Args, Debug)]
#[command(after_help = format!(
    "Rotations: {}\n\n\
     Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
     Example: replica rig new drives/mine --lidar vlp16 --from tf.yaml",
    rotation::FORMS
))]
pub struct Args {
    /// Drive folder for the drive.toml, made if absent, or the name of the file; an existing file is not replaced
    out: PathBuf,
    /// Calibration of another program; several are joined, a tf tree first
    #[arg(long, value_name = "FILE")]
    from: Vec<PathBuf>,
    /// Name of the drive
    #[arg(long)]
    name: Option<String>,
    /// Model of the LiDAR
    #[arg(long, value_parser = model)]
    lidar: Option<Model>,
    /// Files of the LiDAR
    #[arg(long, default_value = "pcap", value_parser = ["pcap", "pcd", "bin", "nuscenes"])]
    format: String,
    /// Position of the LiDAR in the body, m
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    lidar_position: Option<[f64; 3]>,
    /// Rotation of the LiDAR in the body
    #[arg(long, value_name = "ROTATION", value_parser = rotation::parse)]
    lidar_rotation: Option<UnitQuaternion<f64>>,
    /// A further LiDAR: name, model, position (m) and rotation in the body. Once for each; the first one is then named `main`
    #[arg(long, value_name = "NAME=MODEL@X,Y,Z[@ROTATION]", value_parser = secondary_lidar::parse, allow_hyphen_values = true)]
    other_lidar: Vec<SecondaryLidar>,
    /// Position of the frame of the sources in the body, m; without --from, of the LiDAR
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    position: Option<[f64; 3]>,
    /// Rotation of the frame of the sources in the body; without --from, of the LiDAR
    #[arg(long, value_name = "ROTATION", value_parser = rotation::parse)]
    rotation: Option<UnitQuaternion<f64>>,
    /// Body frame of a tf tree; default `base_link`, or the root
    #[arg(long, value_name = "FRAME")]
    body: Option<String>,
    /// Size of the images, for sources that do not have it, px
    #[arg(long, value_name = "W,H", value_parser = size)]
    image_size: Option<[u32; 2]>,
    /// nuScenes: start of the file names of one drive
    #[arg(long)]
    log: Option<String>,
    /// Name of the camera of an OpenCV file
    #[arg(long)]
    camera: Option<String>,
    /// Latitude, longitude (degrees) and ellipsoidal height (m) of the origin of the world frame, with a GNSS receiver
    #[arg(long, value_name = "LAT,LON,H", value_parser = position, allow_hyphen_values = true)]
    gnss_origin: Option<[f64; 3]>,
    /// Position of the antenna in the body, m
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    antenna: Option<[f64; 3]>,
    /// Position of the IMU in the body, m
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    imu_position: Option<[f64; 3]>,
    /// Rotation of the IMU in the body
    #[arg(long, value_name = "ROTATION", value_parser = rotation::parse)]
    imu_rotation: Option<UnitQuaternion<f64>>,
    #[command(flatten)]
    answer: Answer,
}

/// The written rig.
#[derive(Serialize)]
struct Written<'a> {
    file: &'a Path,
    lidar: &'static str,
    n_cameras: usize,
    /// Notes about data that the sources lack.
    notes: &'a [String],
}

impl Written<'_> {
    fn text(&self) -> String {
        let file = format!("{}: {}, {} cameras\n", self.file.display(), self.lidar, self.n_cameras);
        let lines = self.notes.iter().map(String::as_str).chain([file.as_str()]);
        lines.collect::<Vec<_>>().join("\n")
    }
}

fn model(name: &str) -> Result<Model, String> {
    Model::from_name(name).ok_or_else(|| format!("must be one of {}", Model::names()))
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| "must be two whole numbers W,H".to_owned())
}

fn pose(position: Option<[f64; 3]>, rotation: Option<UnitQuaternion<f64>>) -> Option<Pose> {
    let is_given = position.is_some() || rotation.is_some();
    is_given.then(|| {
        Pose::from_parts(
            Translation3::from(position.unwrap_or_default()),
            rotation.unwrap_or_else(UnitQuaternion::identity),
        )
    })
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let is_file = args.out.extension().is_some_and(|extension| extension == "toml") && !args.out.is_dir();
    let out = if is_file { args.out.clone() } else { args.out.join(MANIFEST_FILE) };
    ensure!(
        !args.out.is_file(),
        "{} exists already; expected a folder, or a new file that ends in .toml",
        args.out.display()
    );
    ensure!(!out.exists(), "{} exists already", out.display());
    let parts = parts(args)?;
    let of_lidar = pose(args.lidar_position, args.lidar_rotation)
        .or_else(|| pose(args.position, args.rotation).filter(|_| args.from.is_empty()))
        .or(parts.body_from_lidar);
    let mut answers = Answers {
        name: args.name.clone(),
        model: args.lidar,
        body_from_lidar: of_lidar,
        body_from_imu: pose(args.imu_position, args.imu_rotation).or(parts.body_from_imu),
        antenna_in_body: args.antenna.or(parts.antenna_in_body),
        origin: args.gnss_origin,
    };
    if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        answers = ask(answers, &mut std::io::stdin().lock(), &mut std::io::stderr().lock())?;
    }
    let Some(model) = answers.model else {
        bail!("the model of the LiDAR is unknown; give --lidar MODEL: {}", Model::names())
    };
    let Some(body_from_lidar) = answers.body_from_lidar else {
        bail!("the mounting of the LiDAR is unknown; give --lidar-position X,Y,Z and --lidar-rotation ROTATION");
    };
    let mut lidar = LidarEntry::from_captures(model.name(), body_from_lidar.into());
    lidar.format.clone_from(&args.format);
    let name = answers.name.clone().unwrap_or_else(|| default_name(&out));
    let parts = RigParts { body_from_imu: answers.body_from_imu, antenna_in_body: answers.antenna_in_body, ..parts };
    let mut manifest = parts.manifest(&name, lidar, answers.origin).map_err(anyhow::Error::msg)?;
    manifest.other_lidars = args.other_lidar.iter().map(|other| other.entry(&args.format)).collect();
    if !manifest.other_lidars.is_empty() {
        manifest.lidar.name = Some("main".to_owned());
    }
    let mut text = String::new();
    for note in &parts.notes {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {note}");
    }
    if !manifest.cameras.is_empty() {
        text.push_str("# exposure_nanos is a placeholder: write the exposure times of the cameras\n");
    }
    if parts.antenna_in_body.is_some() && answers.origin.is_none() {
        text.push_str("# without [gnss]: its origin was not given (--gnss-origin)\n");
    }
    text.push_str(&toml::to_string(&manifest)?);
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::write(&out, text).with_context(|| out.display().to_string())?;
    let written = Written { file: &out, lidar: model.name(), n_cameras: manifest.cameras.len(), notes: &parts.notes };
    args.answer.print(&written, || written.text())?;
    Ok(ExitCode::SUCCESS)
}

/// Reads the parts of the rig from the sources.
fn parts(args: &Args) -> anyhow::Result<RigParts> {
    let body_from_source = pose(args.position, args.rotation).filter(|_| !args.from.is_empty());
    let options = SourceOptions {
        body_from_source,
        body_frame: args.body.clone(),
        image_size: args.image_size,
        log: args.log.clone(),
        camera_name: args.camera.clone(),
    };
    let mut parts = RigParts::default();
    let mut tree = FrameTree::default();
    for path in &args.from {
        parts.merge(source::read(path, &options, &mut tree)?);
    }
    parts.mount(&tree, &options).map_err(anyhow::Error::msg)?;
    Ok(parts)
}

/// Default name of the drive: the name of its folder, which may not exist yet.
fn default_name(out: &Path) -> String {
    let folder = out.parent().and_then(|folder| folder.canonicalize().or_else(|_| std::path::absolute(folder)).ok());
    let name = folder.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "drive".to_owned())
}
