-- Series of numbers are big-endian doubles one after the other, as with SQLite: an array is received
-- number by number, which was the dearest part of storing a result.

-- The number at a place of a series, counted from 1 as in an array; null beyond its ends.
create function double_at(series bytea, place bigint) returns double precision
language plpgsql immutable strict parallel safe as $$
declare
    bits bigint;
    exponent integer;
    -- Of 2^52.
    mantissa double precision;
    magnitude double precision;
begin
    if place not between 1 and length(series) / 8 then
        return null;
    end if;
    bits := cast(cast('x' || encode(substring(series from cast(8 * place - 7 as integer) for 8), 'hex')
        as bit(64)) as bigint);
    exponent := (bits >> 52) & 2047;
    mantissa := (bits & 4503599627370495) / 4503599627370496.0::double precision;
    if exponent = 2047 then
        magnitude := case when mantissa = 0 then 'Infinity' else 'NaN' end;
    elsif exponent = 0 then
        magnitude := mantissa * power(2::double precision, -1022);
    else
        magnitude := (1 + mantissa) * power(2::double precision, exponent - 1023);
    end if;
    return case when bits < 0 then -magnitude else magnitude end;
end $$;

-- A series as an array.
create function doubles(series bytea) returns double precision[]
language sql immutable strict parallel safe as $$
    select coalesce(array_agg(double_at(series, place) order by place), '{}')
    from generate_series(1, length(series) / 8) as place
$$;

drop view spectrum;
drop view result_with_parameters;

create function as_series(numbers double precision[]) returns bytea
language sql immutable strict as $$
    select coalesce(string_agg(float8send(number), ''::bytea order by place), '')
    from unnest(numbers) with ordinality as of (number, place)
$$;

alter table result alter column log_power type bytea using as_series(log_power);
alter table stored_array alter column numbers type bytea using as_series(numbers);
drop function as_series;

-- Doubles don't compress: trying would only cost time.
alter table result alter column log_power set storage external;

-- One row a case and speed: what went in, and what came out.
create view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2.
create view spectrum as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    double_at(result.log_power, frequency_bin.bin + 1) as log_power
from result
join frequency_bin using (experiment_hash);
