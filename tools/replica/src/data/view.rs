//! `replica view`: the cloud of a run in the browser.
//!
//! | idea | module |
//! |---|---|
//! | octree and objects of a run, made once | `cached_cloud` |
//! | everything that is shown except the points: `scene.json` | `scene` |
//! | images of the cameras with points over them | `camera_images` |
//! | a run that is not finished | `live_run`, `live_site` |
//! | the page itself, built in `tools/viewer` | `page_files` |

mod cached_cloud;
mod camera_images;
mod live_run;
mod live_site;
mod page_files;
mod scene;

use super::deliver::frame::utm_or_local;
use super::deliver::{COPC_FILE, open_finished_run, progress_bar};
use super::new_folder::NewFolder;
use super::report::finished_run::FinishedRun;
use anyhow::{Context, ensure};
use cached_cloud::CachedCloud;
use camera_images::CameraImages;
use command_line::argument::not_negative;
use command_line::say;
use command_line::terminal::StopFlag;
use command_line::usage_error::UsageError;
use file_server::{Content, Server, Site};
use files::regular_file;
use live_site::LiveSite;
use scene::Scene;

use std::io::{self, ErrorKind, Read};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Default port, if it is free.
const PORT: u16 = 8099;
/// Name of the scene in the site; the points are [`COPC_FILE`].
const SCENE: &str = "scene.json";
/// The first four bytes of every LAS file, and the signature in the description of a COPC file at byte 377.
const LAS_SIGNATURE: &[u8] = b"LASF";
const COPC_SIGNATURE: (usize, &[u8]) = (377, b"copc");

/// Show the cloud of a run in the browser.
///
/// Serves a page until Ctrl-C, by default only to this computer (--host). The first time, the points of a run are written as an
/// octree into the folder `view` of the run; later calls reuse it if the clouds are unchanged. With --live the page follows a run
/// while its clouds are written.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica view out/sample")]
pub struct Args {
    /// Output folder of a finished run (with --live: of any run), or a COPC file (.copc.laz)
    #[arg(value_name = "RUN|FILE")]
    path: PathBuf,
    /// Port; 0 = any free port [default: 8099, or any free port if it is in use]
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// Address to listen on; 0.0.0.0 serves every computer that can reach this one, without password
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    host: IpAddr,
    /// Write the page and all its data into this empty folder instead, for any web server with byte ranges
    #[arg(long, value_name = "DIR", conflicts_with_all = ["port", "host"])]
    out: Option<PathBuf>,
    /// Run: show its clouds while they are written, also if started before the run
    #[arg(long, conflicts_with = "out")]
    live: bool,
    /// Run: add the reflectances of the mosaic cameras to each point
    #[arg(long)]
    bands: bool,
    /// Run: distance along the path between two images of a camera, m; 0 = no images
    #[arg(long, value_name = "M", default_value = "5", value_parser = not_negative)]
    image_step_m: f64,
}

/// Serves or writes the page.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // Errors of folder and address are reported before the octree is made, which takes longer.
    if let Some(out) = &args.out {
        write(&site(args)?, NewFolder::create(out)?, out)?;
        return Ok(ExitCode::SUCCESS);
    }
    let server = bind(args)?;
    let stop = StopFlag::register(run::exit::DONE)?;
    if args.live {
        let live = LiveSite::new(&args.path)?;
        announce(&server)?;
        if live.serve(&server, &stop)? {
            // The page has requested the final cloud. It waits for the answer while the octree is made.
            server.run(&site(args)?, || stop.is_set());
        }
    } else {
        let site = site(args)?;
        announce(&server)?;
        server.run(&site, || stop.is_set());
    }
    Ok(ExitCode::SUCCESS)
}

/// Page, points and scene.
fn site(args: &Args) -> anyhow::Result<Site> {
    let mut site = Site::default();
    page_files::add(&mut site);
    if args.path.is_dir() {
        add_run(args, &mut site)?;
    } else {
        let rule = "--bands needs a run; the bands of a COPC file are fixed when it is written";
        ensure!(!args.bands, UsageError(rule.to_owned()));
        add_file(&args.path, &mut site)?;
    }
    Ok(site)
}

fn write(site: &Site, folder: NewFolder, out: &Path) -> anyhow::Result<()> {
    let bar = progress_bar("view", site.names().count() as u64);
    site.write(&folder.files, |_| bar.inc(1))?;
    folder.finish()?;
    bar.finish_and_clear();
    say!("{}: serve this folder with any web server that answers byte ranges", out.display())?;
    Ok(())
}

fn announce(server: &Server) -> anyhow::Result<()> {
    say!("http://{}/  (Ctrl-C ends)", server.address())?;
    Ok(())
}

fn bind(args: &Args) -> anyhow::Result<Server> {
    let bind = |port| Server::bind(SocketAddr::new(args.host, port));
    let server = match args.port {
        Some(port) => bind(port),
        None => bind(PORT).or_else(|error| if error.kind() == ErrorKind::AddrInUse { bind(0) } else { Err(error) }),
    };
    let port = args.port.unwrap_or(PORT);
    server.with_context(|| format!("cannot listen on {}:{port}\nhint: --port 0 takes any free port", args.host))
}

fn add_file(path: &Path, site: &mut Site) -> anyhow::Result<()> {
    let begin = first_bytes(path).with_context(|| path.display().to_string())?;
    let (at, signature) = COPC_SIGNATURE;
    ensure!(
        begin.starts_with(LAS_SIGNATURE) && begin.get(at..at + signature.len()) == Some(signature),
        "{}: not a COPC file\nhint: `replica deliver RUN --out DIR --copc` writes DIR/points.copc.laz",
        path.display()
    );
    site.add(COPC_FILE, Content::File(path.to_owned()));
    add_scene(&Scene::new(title(path)), site)
}

fn first_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let mut begin = Vec::new();
    regular_file::open(path)?.take(512).read_to_end(&mut begin)?;
    Ok(begin)
}

fn add_run(args: &Args, site: &mut Site) -> anyhow::Result<()> {
    let (summary, run) = open_finished_run(&args.path, "view")?;
    let frame = utm_or_local(&run, &summary)?;
    let CachedCloud { cloud, objects } = CachedCloud::open_or_create(&run, &frame, args.bands)?;
    site.add(COPC_FILE, Content::File(cloud));
    let folder = args.path.canonicalize().with_context(|| args.path.display().to_string())?;
    let mut scene = Scene::new(title(&folder));
    scene.add_run(&run, &frame, objects)?;
    if args.image_step_m > 0.0
        && let Some(images) = CameraImages::open(FinishedRun::load(&args.path)?, args.image_step_m)
    {
        let images = Arc::new(images);
        scene.images = images.places(&frame.target)?;
        images.add_to(site);
    }
    add_scene(&scene, site)
}

/// Last name of a path.
fn title(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn add_scene(scene: &Scene, site: &mut Site) -> anyhow::Result<()> {
    let text = serde_json::to_string(scene)?;
    site.add(SCENE, Content::Bytes(text.into_bytes().into()));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use command_line::argument::Cli;

    #[test]
    fn page_is_served_to_this_computer_alone_by_default() {
        let args = Cli::<Args>::try_parse_from(["view", "run"]).expect("parses").args;
        assert!(args.host.is_loopback() && args.port.is_none());
        assert!(Cli::<Args>::try_parse_from(["view", "run", "--out", "a", "--port", "1"]).is_err());
    }

    #[test]
    fn file_that_is_no_copc_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.laz");
        for bytes in [Vec::new(), b"LASF".to_vec(), [b"LASF".to_vec(), vec![0; 600]].concat()] {
            std::fs::write(&path, &bytes).expect("writes");
            let error = add_file(&path, &mut Site::default()).expect_err("no COPC signature");
            assert!(error.to_string().contains("not a COPC file"), "{error}");
        }
    }
}
