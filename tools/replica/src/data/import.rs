//! `replica import`: imports third-party recordings and data sets as a drive folder, and a Ladybug calibration as entries of a
//! drive.toml.

mod ladybug;

use anyhow::{bail, ensure};
use command_line::say;
use import::{Kind, Options, RosOptions};
use lidar::Model;
use std::path::PathBuf;
use std::process::ExitCode;

/// Import a ROS bag, data set, clouds or camera calibration.
///
/// Labeled clouds become a recording of submaps with their true classes, for `replica replay`. The drive folder links to the
/// original files instead of copying them where possible. Imported and ignored data is listed.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica import recording.bag drives/mine")]
pub struct Args {
    /// ROS bag (*.bag, *.mcap, *.db3, the folder of a ROS 2 bag, or a folder of *.bag); labeled cloud or folder of clouds of
    /// Paris-CARLA-3D, Paris-Lille-3D, Toronto-3D, `Street3D` or Oakland 3-D; folder of KITTI raw (with `velodyne_points/data`), of a KITTI odometry sequence (with `velodyne`), of nuScenes (with
    /// `sweeps/LIDAR_TOP`, or *.pcd.bin), of `MandEye` (with `lidar*.laz`), or of *.bin, *.pcd, *.ply, *.las or *.laz sweeps; or
    /// the calibration file of a Ladybug (.cal)
    source: PathBuf,
    /// Drive folder to create; for labeled clouds the recording (.mcap); for a calibration, the file to write its `[[camera]]` entries of a drive.toml to
    out: PathBuf,
    /// Layout of the source; without it the layout is recognized, and files that do not fit it are refused
    #[arg(long, value_parser = kind)]
    kind: Option<Kind>,
    /// Model of the LiDAR, as in drive.toml; default hdl32e for nuScenes, mid360 for `MandEye`, by packets or number of rings for ROS bags, else hdl64e
    #[arg(long, value_parser = model)]
    model: Option<Model>,
    /// nuScenes: the drive to import if the folder holds several: the file names up to `__LIDAR_TOP__`
    #[arg(long)]
    log: Option<String>,
    /// nuScenes: the scene to import if the tables have several, for example scene-0061
    #[arg(long)]
    scene: Option<String>,
    /// Import the sweeps and their times alone, for example without calibration files
    #[arg(long)]
    lidar_only: bool,
    /// ROS bag: topic of a role: lidar, camera.0, `camera_info.0`, imu, gnss, nmea or metadata (of an Ouster); `none` leaves out camera
    /// (all), imu, gnss or nmea. Other roles are chosen by type
    #[arg(long = "topic", value_name = "ROLE=NAME", value_parser = topic)]
    topics: Vec<(String, String)>,
    /// ROS bag: frame of the body; default `base_link`, else the frame above all others
    #[arg(long, value_name = "NAME")]
    body_frame: Option<String>,
    /// ROS bag: pose of a frame in the body frame, instead of the pose in `tf_static`: m and unit quaternion
    #[arg(long = "transform", value_name = "FRAME=X,Y,Z,QX,QY,QZ,QW", value_parser = transform)]
    transforms: Vec<(String, [f64; 7])>,
    /// ROS bag: a further file of a recording that was split (may be repeated); a folder of *.bag files is read as one recording
    #[arg(long = "part", value_name = "FILE")]
    parts: Vec<PathBuf>,
    /// ROS bag: calibration file of the LiDAR, as lidar.calibration in drive.toml
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// For a Ladybug's calibration: position of the Ladybug in the body frame, m; its axes are parallel to the body's
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', allow_hyphen_values = true, default_value = "0,0,0")]
    position: Vec<f64>,
}

fn kind(name: &str) -> Result<Kind, String> {
    Kind::from_name(name).ok_or_else(|| format!("must be one of {}", Kind::ALL.map(Kind::name).join(", ")))
}

fn model(name: &str) -> Result<Model, String> {
    Model::from_name(name).ok_or_else(|| format!("must be one of {}", Model::names()))
}

fn topic(text: &str) -> Result<(String, String), String> {
    let (role, name) = text.split_once('=').ok_or("must be ROLE=NAME")?;
    Ok((role.to_owned(), name.to_owned()))
}

fn transform(text: &str) -> Result<(String, [f64; 7]), String> {
    let rule = || "must be FRAME=X,Y,Z,QX,QY,QZ,QW with seven numbers".to_owned();
    let (frame, numbers) = text.split_once('=').ok_or_else(rule)?;
    let numbers: Option<Vec<f64>> = numbers.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(rule)?;
    Ok((frame.to_owned(), numbers))
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if args.source.extension().is_some_and(|extension| extension == "cal") {
        ensure!(!args.out.exists(), "{} exists already", args.out.display());
        let [x, y, z] = args.position[..] else { bail!("--position {:?} must be three numbers", args.position) };
        let n_cameras = ladybug::import(&args.source, &args.out, [x, y, z])?;
        say!("{}: {n_cameras} cameras", args.out.display())?;
        return Ok(ExitCode::SUCCESS);
    }
    let ros = RosOptions {
        topics: args.topics.clone(),
        body_frame: args.body_frame.clone(),
        transforms: args.transforms.clone(),
        calibration: args.calibration.clone(),
        parts: args.parts.clone(),
    };
    let options = Options {
        kind: args.kind,
        model: args.model,
        log: args.log.clone(),
        scene: args.scene.clone(),
        lidar_only: args.lidar_only,
        ros,
    };
    for line in import::import(&args.source, &args.out, &options)? {
        say!("{line}")?;
    }
    Ok(ExitCode::SUCCESS)
}
