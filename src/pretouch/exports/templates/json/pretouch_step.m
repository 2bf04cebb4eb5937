function [state, out] = pretouch_step(p, state, sample)
% One control period of the law: the difference equations, block by block, in the order of pretouch_law.c.
%   p:      parameters, the field "parameters" of design.json
%   state:  from pretouch_start or from the last call
%   sample: struct with reading, age [s], contact_force [N], reference_position [m], reference_velocity [m/s],
%           reference_acceleration [m/s^2] and fresh (what arrived since the last period: 0 for nothing, 1 for the
%           reading, 2 if a sensor of distances reports that it sees no object). All others count along
%           the axis of the sensor, positive toward the object: contact_force, the force of the object on the robot, is
%           negative while an object in front of the sensor presses against the robot
%   out:    struct with position [m], velocity [m/s], acceleration [m/s^2], virtual_force [N], log_level and status
    [state.sensing, seen] = observe(p.sensing, state.sensing, sample);
    if isfield(p.law, 'drag')
        [state.law, impulse, force] = drag(p.law, state.law, seen, state.drive);
    else
        [state.law, impulse] = damp(p.law, state.law, seen);
        force = 0;
    end
    [state.drive, out] = drive(p.drive, state.drive, seen, impulse, force, sample);
end

% ---- from a reading to the change of ln xi ----

function [s, seen] = observe(p, s, sample)
    quiet = s.quiet + p.period;
    measured = s.measured + p.period;
    above = sample.reading - p.offset;
    level = p.floor;
    if p.floor < above && above < Inf
        level = above;
    end
    fault = fault_of(p, s, sample, level, measured);
    usable = sample.fresh && fault == 0;
    if usable && sample.fresh ~= 2
        [s, seen] = take_in(p, s, sample.age, level, measured);
        return
    end
    seen.no_object = usable; % nothing has moved: no change, and a new start afterwards
    seen.lost = ~usable && quiet > p.timeout * (1 + 1e-6);
    seen.stale = ~usable && quiet > p.sensor_period * (1 - 1e-6);
    s.quiet = min(quiet, 2 * p.timeout);
    s.measured = min(measured, 3 * p.timeout);
    if usable
        s.latest = 2;
        s.quiet = 0;
        s.measured = sample.age;
        s.level = p.floor;
        s.filtered = p.floor;
    elseif seen.lost
        s.latest = 0;
    end
    if usable || seen.lost
        s.log_level = 0;
    end
    seen.change = 0;
    seen.elapsed = 0;
    seen.log_level = s.log_level;
    seen.level = s.filtered;
    seen.usable = false;
    seen.restarted = false;
    seen.detecting = s.log_level > 0;
    seen.status = seen.detecting + 2 * seen.stale + 32 * seen.lost + fault;
end

function fault = fault_of(p, s, sample, level, measured)
    elapsed = measured - sample.age;
    in_time = 0 <= sample.age && sample.age <= p.timeout;
    in_order = elapsed > 1e-6 * p.period || s.latest == 0;
    largest = p.largest_rate * min(elapsed, p.sensor_period);
    fault = 0;
    if ~sample.fresh
        return
    elseif ~(in_time && in_order)
        fault = 8;
    elseif sample.fresh == 2
        return
    elseif ~isfinite(sample.reading)
        fault = 8;
    elseif sample.reading >= p.saturation
        fault = 4;
    elseif s.latest == 1 && largest < 1500 && abs(log(level / s.level)) > largest && abs(log(level / s.filtered)) > largest
        fault = 16;
    end
end

function [s, seen] = take_in(p, s, age, level, measured)
    restarted = s.latest ~= 1;
    before = s.filtered;
    filtered = level;
    if restarted
        s.readings = level * ones(1, p.median_length);
        s.low_pass = pretouch_steady_low_pass(p, level);
    else
        s.readings = [s.readings(2:end), level];
        filtered = median(s.readings);
        for i = 1:p.sections
            n = p.low_pass(i);
            result = n.b0 * filtered + s.low_pass(i, 1);
            s.low_pass(i, :) = [n.b1 * filtered - n.a1 * result + s.low_pass(i, 2), n.b2 * filtered - n.a2 * result];
            filtered = result;
        end
    end
    s.latest = 1;
    s.quiet = 0;
    s.measured = age;
    s.level = level;
    s.filtered = p.floor; % for an undershoot of the low-pass, and its rounding
    if filtered > p.floor * (1 + 1e-9)
        s.filtered = filtered;
    end
    s.log_level = log(s.filtered / p.floor);
    seen = struct('change', 0, 'log_level', s.log_level, 'level', s.filtered, 'elapsed', 0, 'usable', true, ...
                  'restarted', restarted, 'no_object', false, 'detecting', s.log_level > 0, 'stale', false, ...
                  'lost', false);
    if ~restarted
        seen.change = log(s.filtered / before);
        seen.elapsed = measured - age;
    end
    seen.status = double(seen.detecting);
end

% ---- the virtual damper: the impulse is D_p times the change of ln xi ----

function [s, impulse] = damp(p, s, seen)
    share = s.ramp; % the change down to the floor still counts
    if seen.detecting
        share = min(s.ramp + p.ramp_step, 1);
        s.ramp = share;
    else
        s.ramp = max(s.ramp - p.ramp_step, 0);
    end
    before = s.mark;
    if seen.restarted
        before = seen.log_level;
    end
    mark = before;
    if seen.usable
        mark = min(max(before, seen.log_level), seen.log_level + p.release);
    end
    change = seen.change;
    if p.approach_only
        change = max(mark - before, 0);
    end
    s.mark = mark;
    impulse = p.gain * share * change;
end

% ---- the virtual drag: phi times the rate of ln xi times its rise ----

function [s, impulse, force] = drag(p, s, seen, driven)
    x = driven.position;
    v = driven.velocity;
    ahead = p.period / 2;
    fast = 0;
    rise = 0;
    if seen.usable
        sigma = sqrt(p.variance + p.relative_variance * seen.level^2) / seen.level;
        width = p.width * sigma;
        still = p.still * sigma;
        rate = s.rate;
        expected = s.level + rate * seen.elapsed;
        if seen.restarted
            rate = 0;
            expected = seen.log_level;
        end
        missed = seen.log_level - expected;
        s.level = expected + p.level_share * missed;
        largest = 1500 / p.sensor_period;
        s.rate = max(min(rate + p.rate_share * missed / max(seen.elapsed, p.sensor_period), largest), -largest);
        mark = s.mark;
        if seen.restarted
            mark = s.level + width;
        end
        rise = max(s.level - mark, 0) * seen.detecting;
        s.mark = min(max(mark, s.level), s.level + width);
        if s.rate > still
            fast = sqrt((s.rate - still) * (s.rate + still));
        end
    end
    own = 0;
    if v > 0
        own = max(p.own_advance * rise, -p.mass * v); % brakes to rest at most
    end
    remaining = s.hold;
    if rise > 0
        remaining = p.hold;
    end
    approaching = seen.detecting && remaining > 0;
    pull = p.stiffness * (x + ahead * v) + p.damping * (v + ahead * driven.steady / p.mass);
    s.hold = 0;
    force = 0;
    if approaching
        s.hold = max(remaining - p.period, 0);
        force = p.mass * p.known_acceleration;
        if v <= 0
            force = force + min(pull, 0);
        end
    end
    impulse = own - p.drag * fast * rise;
end

% ---- from the impulse to the motion ----

function [s, out] = drive(p, s, seen, impulse, push, sample)
    period = p.limits.period;
    [s, delivered] = deliver(p, s, seen, impulse);
    virtual_force = max(min(delivered + push, p.largest_force), -p.largest_force);
    no_force = ~(abs(sample.contact_force) <= 1e9);
    contact_force = sample.contact_force;
    if no_force
        contact_force = 0;
    end
    force = virtual_force + p.contact_gain * contact_force;
    a = p.admittance;
    next_x = a.position_from_position * s.position + a.position_from_velocity * s.velocity + a.position_from_force * force;
    next_v = a.velocity_from_position * s.position + a.velocity_from_velocity * s.velocity + a.velocity_from_force * force;
    [next_x, next_v, limited] = limit_motion(p.limits, s.position, s.velocity, next_x, next_v);
    references = [sample.reference_position, sample.reference_velocity, sample.reference_acceleration];
    no_reference = ~all(abs(references) <= 1e6);
    if no_reference
        references = [s.reference, 0, 0];
    end
    out.position = references(1) + period * (references(2) + period / 2 * references(3)) + next_x;
    out.velocity = references(2) + period * references(3) + next_v;
    out.acceleration = references(3) + (next_v - s.velocity) / period;
    out.virtual_force = virtual_force;
    out.log_level = seen.log_level;
    out.status = seen.status + 64 * (abs(virtual_force) >= p.largest_force) + ...
                 256 * (abs(contact_force) >= p.contact_threshold) + 128 * limited + 512 * (no_force || no_reference);
    s.position = next_x;
    s.velocity = next_v;
    s.reference = references(1);
end

function [s, force] = deliver(p, s, seen, impulse)
% An impulse as a constant force over one sensor period. The force of a late reading continues and fades; the next
% reading corrects the difference.
    period = p.limits.period;
    if seen.usable
        owed = impulse + s.rest;
        due = owed - s.ahead;
        covers = (owed > 0 && 0 < due) || (owed < 0 && 0 > due);
        s.steady = 0;
        s.ahead = -due;
        if covers
            s.steady = max(min(due / p.hold, p.largest_force), -p.largest_force);
            s.ahead = 0;
        end
        s.rest = s.steady * p.hold;
        s.fading = 1;
    end
    if seen.no_object % the impulse of the measured motion still acts; nothing follows it, and the next object owes nothing
        s.ahead = 0;
        s.fading = 0;
    end
    if s.rest ~= 0
        given = s.steady * period;
        force = s.steady;
        if abs(s.rest) <= abs(given) * (1 + 1e-9)
            force = s.rest / period;
            s.rest = 0;
        else
            s.rest = s.rest - given;
        end
        return
    end
    s.rest = 0;
    force = 0;
    if seen.stale
        s.fading = max(s.fading - p.fade_step, 0);
        force = s.steady * s.fading;
        s.ahead = (s.ahead + force * period) * ~seen.lost;
    end
end

function [next_x, next_v, limited] = limit_motion(p, x, v, next_x, next_v)
% Limits of speed, acceleration and excursion that hold together: a speed is allowed if the robot can stop from it.
    step = p.acceleration * p.period;
    drifted = v * p.period;
    moved = next_x - x;
    low = max(-p.speed, v - step);
    high = min(p.speed, v + step);
    steady = abs(moved) <= p.speed * p.period && abs(moved - drifted) <= step * p.period / 2;
    limited = false;
    if steady && low <= next_v && next_v <= high
        ahead = next_x;
        if next_v < 0
            ahead = -next_x;
        end
        if abs(next_x) <= p.excursion && ahead + stopping_distance(p, abs(next_v)) <= p.excursion
            return
        end
    end
    limited = true;
    high = min(high, fastest(p, p.excursion - x - drifted / 2));
    low = max(low, -fastest(p, p.excursion + x + drifted / 2));
    next_v = max(min(next_v, high), low);
    next_x = max(min(x + drifted / 2 + p.period * next_v / 2, p.excursion), -p.excursion);
end

function distance = stopping_distance(p, speed)
    step = p.acceleration * p.period;
    whole = floor(speed / step);
    rest = speed - whole * step;
    distance = p.period * (step / 2 * whole * whole + rest * (whole + 0.5));
end

function speed = fastest(p, room)
    step = p.acceleration * p.period;
    room = max(room, 0);
    whole = floor((sqrt(1 + 8 * room / (step * p.period)) - 1) / 2);
    speed = step * whole + (room - step * p.period / 2 * whole * (whole + 1)) / (p.period * (whole + 1));
end
