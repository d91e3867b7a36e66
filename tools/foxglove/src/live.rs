//! A running pipeline, served by Foxglove's WebSocket protocol.

use crate::scene::Scene;
use anyhow::Context as _;
use foxglove::{Context, WebSocketServer};
use ipc::{Attached, Observer, ObserverMode};
use messages::ByteTable;
use run::observed_run::{ObservedRun, channels};
use run::wiring::Wiring;
use std::net::IpAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Observers are not notified, so they poll.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Serves a run, across its restarts, until it ends. Messages that the clients are too slow for are left out: the run never
/// waits.
pub fn serve(output: &Path, bind: IpAddr, port: u16, points: usize) -> anyhow::Result<()> {
    let mut run = ObservedRun::read(output)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).context("signals")?;
    }
    let context = Context::new();
    let server = WebSocketServer::new().name("REPLICA").bind(bind.to_string(), port).context(&context);
    let server = server.start_blocking().with_context(|| format!("{bind}:{port}"))?;
    println!("ws://{bind}:{}", server.port());
    let is_stopped = || stop.load(Ordering::Relaxed);
    loop {
        let attached = run.attach(
            |node, wiring| {
                let open = |table: &ByteTable| {
                    Observer::open(node, &channels(wiring, &table.topic)?.messages, ObserverMode::Dropping)
                };
                shown(wiring).iter().map(open).collect::<Result<Vec<_>, _>>()
            },
            is_stopped,
        )?;
        let Some(mut observers) = attached else { break };
        let tables = shown(&run.wiring);
        // The next attempt repeats the unfinished work of this one.
        let mut scene = Scene::new(&context, points);
        scene.expect_columns(tables.iter().map(|table| table.topic.as_str()));
        while !is_stopped() {
            let has_ended = run.has_ended(&observers);
            let received = receive(&mut observers, &tables, &mut scene);
            match received {
                Err(ServeError::Ipc(error)) => {
                    run.ignore_if_ended(&observers, error)?;
                    break;
                }
                Err(ServeError::Message(error)) => return Err(error),
                Ok(0) if has_ended => break,
                Ok(0) => std::thread::sleep(POLL_INTERVAL),
                Ok(_) => {}
            }
        }
        scene.finish();
    }
    server.stop().wait_blocking();
    Ok(())
}

/// Layouts of the topics of a run that are shown.
fn shown(wiring: &Wiring) -> Vec<ByteTable> {
    let topics = wiring.stages.iter().flat_map(|stage| &stage.outputs).map(|topic| &topic.table);
    topics.filter(|table| Scene::TOPICS.contains(&table.topic.as_str())).cloned().collect()
}

enum ServeError {
    Ipc(ipc::IpcError),
    Message(anyhow::Error),
}

/// Shows the next message of each topic. Returns the number of messages.
fn receive(
    observers: &mut Attached<Vec<Observer>>,
    tables: &[ByteTable],
    scene: &mut Scene,
) -> Result<usize, ServeError> {
    let mut n = 0;
    for (observer, table) in observers.iter_mut().zip(tables) {
        if let Some(message) = observer.receive().map_err(ServeError::Ipc)? {
            scene.show(table, message.envelope(), message.header(), message.rows()).map_err(ServeError::Message)?;
            n += 1;
        }
    }
    Ok(n)
}
