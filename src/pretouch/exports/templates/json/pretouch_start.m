function state = pretouch_start(p)
% State of the law before the first step: no object is detected, and the robot rests at its reference.
%   p: parameters, the field "parameters" of design.json
    state.sensing = struct('quiet', 0, 'measured', 0, 'level', p.sensing.floor, 'filtered', p.sensing.floor, ...
                           'log_level', 0, 'readings', p.sensing.floor * ones(1, p.sensing.median_length), ...
                           'low_pass', pretouch_steady_low_pass(p.sensing, p.sensing.floor), 'latest', 0);
    state.drive = struct('steady', 0, 'rest', 0, 'ahead', 0, 'fading', 0, 'position', 0, 'velocity', 0, 'reference', 0);
    if isfield(p.law, 'drag')
        state.law = struct('level', 0, 'rate', 0, 'mark', 0, 'hold', 0);
    else
        state.law = struct('ramp', 0, 'mark', 0);
    end
end
