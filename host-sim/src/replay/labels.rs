//! Names of reasons in reports.

use kou_estimator::Reason;

/// Name of a reason with its channel or direction, for instance `p_h:open` or `outside_region:speed`.
#[must_use]
pub fn reason_label(reason: Reason) -> String {
    match reason {
        Reason::Sensor(channel, fault) => format!("{}:{}", channel.name(), fault.name()),
        Reason::OutsideRegion(direction) => format!("{}:{}", reason.name(), direction.name()),
        _ => reason.name().to_string(),
    }
}
