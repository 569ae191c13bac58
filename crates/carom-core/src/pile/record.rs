//! Multipliers of pile contacts in the rows that the rest of the core reads.

use crate::contact::Contact;
use glam::DVec3;

/// Rows of an impulse and a moment in the frame `normal`, `t1`, `t2` of the contact.
pub fn packed(c: &Contact, normal: DVec3, impulse: DVec3, moment: DVec3) -> [f64; 6] {
    let mut rows = [0.0; 6];
    rows[0] = impulse.dot(normal);
    let mut next = 1;
    if c.bounds.sliding > 0.0 {
        rows[1] = impulse.dot(c.t1);
        rows[2] = impulse.dot(c.t2);
        next = 3;
    }
    if c.bounds.rolling > 0.0 {
        rows[next] = moment.dot(c.t1);
        rows[next + 1] = moment.dot(c.t2);
        next += 2;
    }
    if c.bounds.spinning > 0.0 {
        rows[next] = moment.dot(normal);
    }
    rows
}

/// Position multipliers of a contact as vectors of the world: of forces, and of moments.
pub fn position(c: &Contact, normal: DVec3) -> [DVec3; 2] {
    let force = if c.bounds.sliding > 0.0 {
        c.nu[0] * normal + c.nu[1] * c.t1 + c.nu[2] * c.t2
    } else {
        c.nu[0] * normal
    };
    [force, c.to_world(normal, &c.nu).moment]
}

/// Turns the frame of a contact to `normal`: its position multipliers keep their components along the normal and across.
pub fn turn_frame(c: &mut Contact, normal: DVec3) {
    let (t1, t2) = (c.t1, c.t2);
    set_frame(c, normal);
    let mut row = 1;
    for present in [c.bounds.sliding > 0.0, c.bounds.rolling > 0.0] {
        if present {
            let across = c.nu[row] * t1 + c.nu[row + 1] * t2;
            (c.nu[row], c.nu[row + 1]) = (across.dot(c.t1), across.dot(c.t2));
            row += 2;
        }
    }
}

/// The frame of all rows at the end of the step, where this is the normal.
pub fn set_frame(c: &mut Contact, normal: DVec3) {
    (c.t1, c.t2) = carom_geom::tangent_frame(normal);
    c.end_frame = true;
}
