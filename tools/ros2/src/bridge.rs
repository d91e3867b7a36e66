//! Finds topics, subscribes to them, and passes their messages on.

use crate::arguments::Args;
use crate::choice::{ChosenTopics, Topics, choose};
use crate::feed::Feed;
use crate::names::{topic_from_dds, type_from_dds};
use crate::roles::Role;
use crate::sinks::Sink;
use crate::subscription::Subscription;
use anyhow::{Context, anyhow};
use import::LiveSensor;
use rustdds::policy::Reliability;
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Wake, Waker};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

/// Interval between two searches for topics.
const LOOK: Duration = Duration::from_millis(250);
/// Ctrl-C takes effect within this time.
const MAX_PARK: Duration = Duration::from_millis(100);
/// Largest number of rounds of messages of a topic that are taken after Ctrl-C.
const MAX_LAST_ROUNDS: usize = 16;
/// The kernel may grant less (`net.core.rmem_max`). Several cameras send their images at the same moment.
const RECEIVE_BUFFER: usize = 32 << 20;

/// Wakes the thread of the bridge.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

/// A topic that publishers offer.
struct Offer {
    dds_name: String,
    dds_type: String,
    kind: String,
    /// Whether all its publishers are reliable.
    is_reliable: bool,
}

struct Bridge<'a> {
    args: &'a Args,
    participant: DomainParticipant,
    feeds: Vec<Feed>,
    begin: Instant,
    /// When the first topic of a sensor was found.
    found: Option<Instant>,
    /// Whether sensors were chosen by type.
    is_chosen: bool,
    /// Whether the bridge has reported what it waits for.
    has_reported: bool,
}

/// Runs until Ctrl-C. Returns whether nothing was lost.
pub fn run(args: &Args) -> anyhow::Result<bool> {
    let stop = stop_flag().context("cannot register signal handlers")?;
    let builder = DomainParticipantBuilder::new(args.domain).socket_receive_buffer_size(RECEIVE_BUFFER);
    let participant = builder.build().map_err(|error| anyhow!("cannot join domain {}: {error}", args.domain))?;
    let begin = Instant::now();
    let mut bridge =
        Bridge { args, participant, feeds: Vec::new(), begin, found: None, is_chosen: false, has_reported: false };
    let waker = Waker::from(Arc::new(Unpark(thread::current())));
    let mut next_look = begin;
    while !stop.load(Ordering::Relaxed) {
        if Instant::now() >= next_look {
            bridge.look()?;
            next_look = Instant::now() + LOOK;
        }
        let mut has_more = false;
        for feed in &mut bridge.feeds {
            has_more |= feed.take(&waker);
        }
        if !has_more {
            thread::park_timeout(MAX_PARK);
        }
    }
    // Received messages are also written, but not the endless messages of a fast publisher.
    for feed in &mut bridge.feeds {
        let _ = (0..MAX_LAST_ROUNDS).all(|_| feed.take(&waker));
    }
    let is_subscribed = !bridge.feeds.is_empty();
    if !is_subscribed {
        eprintln!("no topic was taken");
    }
    // All feeds are finished, even after one that lost messages.
    let complete = bridge.feeds.into_iter().map(Feed::finish).filter(|is_complete| !is_complete).count() == 0;
    Ok(complete && is_subscribed)
}

/// The first signal sets the flag. The second ends the process at once.
fn stop_flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // The order matters: the first signal must find the flag unset.
        signal_hook::flag::register_conditional_shutdown(signal, i32::from(crate::INCOMPLETE), Arc::clone(&flag))?;
        signal_hook::flag::register(signal, Arc::clone(&flag))?;
    }
    Ok(flag)
}

impl Bridge<'_> {
    /// Subscribes to topics that have appeared.
    fn look(&mut self) -> anyhow::Result<()> {
        let offers = self.offers();
        for feed in &mut self.feeds {
            let is_reliable = offers.get(&feed.topic).is_none_or(|offer| offer.is_reliable);
            if feed.subscription.is_reliable() && !is_reliable {
                // A reliable subscription would not match the publisher that has appeared.
                feed.subscription.relax()?;
                eprintln!("{} ({}): best effort, as another of its publishers", feed.topic, feed.role);
            }
        }
        let wishes = self.args.topics.iter();
        let mut found: Vec<(Role, String)> = wishes.filter(|(_, topic)| offers.contains_key(topic)).cloned().collect();
        let has_sensor = offers.values().any(|offer| LiveSensor::from_type(&offer.kind).is_some());
        if has_sensor && self.found.is_none() {
            self.found = Some(Instant::now());
        }
        let discover = Duration::from_secs_f64(self.args.discover);
        if !self.is_chosen && self.found.is_some_and(|found| found.elapsed() >= discover) {
            self.is_chosen = true;
            let topics: Topics = offers.iter().map(|(topic, offer)| (topic.clone(), offer.kind.clone())).collect();
            let ChosenTopics { roles: chosen, notes } = choose(&topics, self.args)?;
            for note in notes {
                eprintln!("{note}");
            }
            found.extend(chosen);
        }
        for (role, topic) in found {
            if !self.feeds.iter().any(|feed| feed.role == role)
                && let Some(offer) = offers.get(&topic)
            {
                self.subscribe(role, topic, offer)?;
            }
        }
        if !self.has_reported && self.begin.elapsed() >= discover + LOOK {
            self.has_reported = true;
            self.report_waiting(&offers);
        }
        Ok(())
    }

    /// Topics of ROS with their types.
    fn offers(&self) -> BTreeMap<String, Offer> {
        let mut offers: BTreeMap<String, Offer> = BTreeMap::new();
        let mut writers: Vec<_> = self.participant.discovered_writers();
        writers.sort_by_key(|writer| writer.publication_topic_data.key);
        for writer in writers {
            let data = writer.publication_topic_data;
            let (Some(topic), Some(kind)) = (topic_from_dds(&data.topic_name), type_from_dds(&data.type_name)) else {
                continue;
            };
            // A writer that does not declare its reliability is reliable.
            let is_reliable = !matches!(data.reliability, Some(Reliability::BestEffort));
            match offers.get_mut(&topic) {
                Some(offer) if offer.kind == kind => offer.is_reliable &= is_reliable,
                Some(_) => {}
                None => {
                    let dds_name = data.topic_name;
                    let dds_type = data.type_name;
                    offers.insert(topic, Offer { dds_name, dds_type, kind, is_reliable });
                }
            }
        }
        offers
    }

    fn subscribe(&mut self, role: Role, topic: String, offer: &Offer) -> anyhow::Result<()> {
        role.check(&topic, &offer.kind)?;
        let args = self.args;
        let target = |target: Option<_>| target.ok_or_else(|| anyhow!("{role}: {} is not set", role.option()));
        let sink = match &role {
            Role::Camera(index) => Sink::folder(folder(args)?.join(format!("camera/{index}")))?,
            Role::Mosaic(name) => Sink::folder(folder(args)?.join(name))?,
            Role::Imu => Sink::udp(target(args.imu)?, "\n")?,
            Role::Gnss | Role::Nmea => Sink::udp(target(args.nmea)?, "\r\n")?,
            Role::Lidar(index) => Sink::udp(target(args.lidar.get(*index).copied())?, "")?,
        };
        let is_reliable = offer.is_reliable && !args.best_effort;
        let is_image = matches!(sink, Sink::Folder(_));
        let names = [offer.dds_name.as_str(), &offer.dds_type];
        let subscription = Subscription::new(&self.participant, names, is_image, is_reliable)?;
        let reliability = if is_reliable { "reliable" } else { "best effort" };
        eprintln!("{topic} ({role}): {}, {reliability}", offer.kind);
        self.feeds.push(Feed::new(role, topic, &offer.kind, subscription, sink)?);
        Ok(())
    }

    /// Names the topics that are absent, once.
    fn report_waiting(&self, offers: &BTreeMap<String, Offer>) {
        for (role, topic) in self.args.topics.iter().filter(|(_, topic)| !offers.contains_key(topic)) {
            eprintln!("waiting for {topic} ({role})");
        }
        if self.found.is_none() && self.args.topics.is_empty() {
            let domain = self.args.domain;
            let n = offers.len();
            eprintln!(
                "waiting: domain {domain} has no topic of a sensor ({n} other topics); see ROS_DOMAIN_ID and the network of the rig"
            );
        }
    }
}

fn folder(args: &Args) -> anyhow::Result<&std::path::Path> {
    args.cameras.as_deref().context("--cameras is not set")
}
