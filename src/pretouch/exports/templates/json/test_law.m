function test_law()
% Replays vectors.csv through pretouch_step and prints the largest difference of each output, relative to its largest
% value. Runs in MATLAB and in Octave; an error means that the law does not compute what pretouch computed.
    design = jsondecode(fileread('design.json'));
    p = design.parameters;
    inputs = {'reading', 'age', 'contact_force', 'reference_position', 'reference_velocity', 'reference_acceleration'};
    outputs = {'position', 'velocity', 'acceleration', 'virtual_force', 'log_level'};
    lines = strsplit(strtrim(fileread('vectors.csv')), sprintf('\n'));
    largest = zeros(1, 5);
    difference = zeros(1, 5);
    last = -1;
    steps = 0;
    flags = 0;
    for i = 1:numel(lines)
        row = str2double(strsplit(strtrim(lines{i}), ','));
        if numel(row) ~= 14 || isnan(row(1))
            continue % a comment, or the names of the columns
        end
        if row(1) ~= last
            state = pretouch_start(p);
            last = row(1);
        end
        for k = 1:6
            sample.(inputs{k}) = row(k + 1);
        end
        sample.fresh = row(8);
        [state, out] = pretouch_step(p, state, sample);
        for k = 1:5
            largest(k) = max(largest(k), abs(row(k + 8)));
            difference(k) = max(difference(k), abs(out.(outputs{k}) - row(k + 8)));
        end
        flags = flags + (out.status ~= row(14));
        steps = steps + 1;
    end
    relative = difference ./ max(largest, realmin);
    for k = 1:5
        fprintf('%-14s %.3g\n', outputs{k}, relative(k));
    end
    fprintf('%d steps, %d with other status flags\n', steps, flags);
    if steps == 0 || flags > 0 || ~all(relative <= 1e-9)
        error('test_law:failed', 'the law does not compute the test vectors');
    end
end
