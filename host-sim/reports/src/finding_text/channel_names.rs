//! The names of channels in sentences and tables.

use crate::formatting::words;
use noise_analysis::report::ChannelReport;

/// The name of a channel, such as `accel x`.
pub(crate) fn channel_name(channel: &ChannelReport) -> String {
    channel_list([&channel.name])
}

/// Prefixes of gyros, accelerometers and magnetometers; the others are conditions.
pub(crate) const SENSED: [&str; 3] = ["gyro_", "accl_", "magn_"];

/// Gyros and accelerometers, in a list of channels.
pub(crate) const ALL_CHANNELS: &str = "all channels";

/// The channels of a list in few words: `gyros` for all three, `accel x y` for two.
#[must_use]
pub fn channel_list<N: AsRef<str>>(names: impl IntoIterator<Item = N>) -> String {
    let names: Vec<N> = names.into_iter().collect();
    list(&names.iter().map(AsRef::as_ref).collect::<Vec<&str>>())
}

fn list(names: &[&str]) -> String {
    let axes = |prefix: &str| -> Vec<&str> { names.iter().filter_map(|name| name.strip_prefix(prefix)).collect() };
    let (gyros, accelerometers, magnetometers) = (axes("gyro_"), axes("accl_"), axes("magn_"));
    if gyros.len() == 3 && accelerometers.len() == 3 {
        return ALL_CHANNELS.to_owned();
    }
    let group = |axes: &[&str], one: &str, all: &str| match axes {
        [] => None,
        axes if axes.len() == 3 => Some(all.to_owned()),
        axes => Some(format!("{one} {}", axes.join(" "))),
    };
    let groups = [
        group(&gyros, "gyro", "gyros"),
        group(&accelerometers, "accel", "accels"),
        group(&magnetometers, "magn", "magns"),
    ];
    let others = names.iter().filter(|name| SENSED.iter().all(|prefix| !name.starts_with(prefix)));
    groups.into_iter().flatten().chain(others.map(|name| words(name))).collect::<Vec<_>>().join(", ")
}
