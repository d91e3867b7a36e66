//! A LiDAR on the network: its data is recorded without loss while other stages are killed and stopped, and processing
//! the recording offline gives the same files as processing the capture itself.

use replica_tests::{Launch, PATIENT, binary, drive, output_text, result_files, wait_for};
use rustix::process::{Signal, kill_process};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Stdio};

/// The stages that need no camera. A live recording has only the LiDAR, so odometry and georeferencing use no other
/// sensor: sentences without a height are not a doubt.
fn launch(run: &str, acquire: &str) -> Launch {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    Launch::new(&format!(
        "[run]\noutput = 'out'\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{PATIENT}\n{run}\n[acquire]\nmin_fix_share = 0.0\n{acquire}\n\
         [slam_aggregate]\nsubmap_m = 3.0\nmotion = []\ncorrect = ['loops']\n[infer]\nmodel = '{}'\n[instance]\nthings = [{{ class = 'vehicles', max_height_m = 4.0, min_points = 200 }}]\n[export]\n",
        model.display()
    ))
}

fn offline(drive: &Path) -> Launch {
    let launch = launch(&format!("drive = '{}'", drive.display()), "");
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    launch
}

/// A port that is currently free.
fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.local_addr().expect("an address").port()
}

/// Plays the drive to a live run in which stages are killed and stopped. `None` if the kernel dropped packets, which is
/// counted and not a fault of the run.
fn live(drive: &Path) -> Option<Launch> {
    let [data, position] = [free_port(), free_port()];
    let run = format!("mode = 'live'\nrig = '{}'", drive.display());
    let acquire = format!("listen = '127.0.0.1:{data}'\nposition_listen = '127.0.0.1:{position}'");
    let launch = launch(&run, &acquire);
    let running = launch.start();
    let capture = launch.output().join("recording/lidar/000.pcap");
    wait_for("the recording", || capture.is_file().then_some(()));
    let mut sender = Command::new(binary("replica"))
        .arg("send")
        .arg(drive)
        .args(["--to", &format!("127.0.0.1:{data}"), "--position-port", &position.to_string()])
        .stderr(Stdio::null())
        .spawn()
        .expect("replica starts");
    // During most of the drive, stages after acquire are stopped or dead.
    let stopped = running.stage("infer");
    kill_process(stopped, Signal::STOP).expect("the stage lives");
    let slam = running.stage("slam_aggregate");
    wait_for("a megabyte", || (std::fs::metadata(&capture).ok()?.len() > 1 << 20).then_some(()));
    kill_process(slam, Signal::KILL).expect("the stage lives");
    wait_for("four megabytes", || (std::fs::metadata(&capture).ok()?.len() > 4 << 20).then_some(()));
    kill_process(stopped, Signal::CONT).expect("the stage lives");
    assert!(sender.wait().expect("waits").success());
    // Data that was sent waits in the sockets, and acquire reads it at the end. (An end by silence would be too early
    // where a busy machine does not run the sender for long.)
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3), "done, with a stage that was killed: {}", launch.stderr());
    assert_eq!(launch.summary()["total"]["restarts"], 1, "{}", launch.stderr());
    let counters = &launch.stage_summary("acquire")["counters"];
    counters["udp_packets_dropped"].as_u64().unwrap_or_default().eq(&0).then_some(launch)
}

#[test]
fn sensor_data_is_recorded_while_other_stages_fail() {
    let drive = drive();
    let live = (0..5).find_map(|_| live(&drive)).expect("the kernel dropped packets each time");
    let direct = offline(&drive);
    let recorded = offline(&live.output().join("recording"));
    let expected = result_files(&direct.output());
    let got = result_files(&recorded.output());
    assert!(expected.len() > 3, "{:?}", expected.keys());
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>());
    for (name, bytes) in &expected {
        assert!(*bytes == got[name], "{name} of the recording differs from the capture");
    }
    // The live run itself gave at least one cloud.
    assert!(live.stage_summary("export")["counters"]["clouds"].as_u64() > Some(0), "{}", live.stderr());
}
