/** Documents of the service, written by `types.mjs` from the OpenAPI document of the service. Do not edit. */

export interface paths {
    "/v1/forecast": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["forecast"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/forecast/update": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["update"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/forecast/difference": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["difference"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/advice": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["advice"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/forecast/batch": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["batch"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/routes": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["route"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/journeys": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["plan"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/journeys/difference": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["journey_difference"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/journeys/advice": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["journey_advice"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/reachable": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["reach"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/need": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_need"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/range": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_range"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/places": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_places"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/map": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_map"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/map/view": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_view"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/tiles/{zoom}/{column}/{row}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_tile"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/models": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_models"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/vehicles": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_vehicles"];
        put?: never;
        post: operations["describe"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/examples": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_examples"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/examples/{trip}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_example"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/healthz": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["healthz"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/readyz": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["readyz"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/metrics": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_metrics"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/fleet/needs": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["fleet_needs"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/fleet/report/{file}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_fleet_report"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/telemetry": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["telemetry"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/live": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["list_live"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/live/{car}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_live"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/live/{car}/plan": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put: operations["put_plan"];
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/live/{car}/events": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_events"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["list_cars"];
        put?: never;
        post: operations["new_car"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars/{car}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get: operations["get_car"];
        put?: never;
        post?: never;
        delete: operations["forget_car"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars/{car}/token": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["new_token"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars/{car}/uploads/{upload}/{file}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put: operations["put_file"];
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars/{car}/uploads/{upload}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["read_logs"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/cars/{car}/uploads/{upload}/learn": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post: operations["learn"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
}
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        ActionDocument: {
            /** @enum {string} */
            code: "slower" | "calmer" | "setpoint" | "seats" | "climate_off" | "preheat_cabin" | "preheat_battery" | "no_roof_box" | "summer_tyres" | "check_tyres" | "pump_up" | "less_luggage" | "other_road" | "leave_later" | "stop";
            value: number | null;
            /** @enum {string} */
            effort: "none" | "little" | "some" | "much";
            wall_wh: number;
            before_s: number;
        };
        AdviceRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            trip?: string;
            samples?: {
                time_s: number[];
                speed_m_s: number[];
                elevation_m?: (number | null)[];
                grade?: (number | null)[];
                speed_limit_m_s?: (number | null)[];
                ambient_temperature_degc?: (number | null)[];
                cabin_temperature_degc?: (number | null)[];
                cabin_setpoint_degc?: (number | null)[];
                battery_temperature_degc?: (number | null)[];
                voltage_v?: (number | null)[];
                current_a?: (number | null)[];
                bms_soc?: (number | null)[];
                displayed_soc?: (number | null)[];
                motor_torque_nm?: (number | null)[];
                heating_power_w?: (number | null)[];
                requested_heating_power_w?: (number | null)[];
                aircon_power_w?: (number | null)[];
                climate_power_w?: (number | null)[];
            } | null;
            links?: components["schemas"]["Link"][] | null;
            elevation?: components["schemas"]["Elevation"] | null;
            reserve?: number | null;
            probability?: number | null;
            chance?: number;
        };
        AdviceResponse: {
            reserve: number;
            chance: number;
            p_arrive: number;
            soc_arrival: number;
            charge_to: number;
            least: components["schemas"]["AdvisedDocument"][];
            singly: components["schemas"]["AdvisedDocument"][];
            whole: components["schemas"]["WholeDocument"] | null;
            speeds: components["schemas"]["SpeedCapDocument"][];
            flags: components["schemas"]["FlagDocument"][];
        };
        AdvisedDocument: {
            actions: components["schemas"]["ActionDocument"][];
            difference: components["schemas"]["DifferenceDocument"];
            soc_arrival: number;
            p_arrive: number;
            /** @enum {string} */
            effort: "none" | "little" | "some" | "much";
            wall_wh: number;
            interaction_wh: number;
            whole: components["schemas"]["WholeDocument"] | null;
        };
        AlikeDocument: {
            what: string;
            count: number;
            places: number;
            example: string;
        };
        AreaDocument: {
            probability: number;
            polygon: components["schemas"]["PolygonDocument"];
        };
        CarResponse: {
            name: string;
            label: string;
            vehicle: string;
            title: string;
            trips: number;
            in_diary: number;
            left_out: {
                [key: string]: string;
            };
            has_token: boolean;
            learned: {
                [key: string]: components["schemas"]["LearnedParameter"];
            };
            experts: {
                [key: string]: number;
            };
            score: components["schemas"]["ScoreDocument"];
            latest: components["schemas"]["ScoreDocument"];
            latest_by_book: components["schemas"]["ScoreDocument"];
            by_temperature: {
                [key: string]: components["schemas"]["ScoreDocument"];
            };
            by_season: {
                [key: string]: components["schemas"]["SeasonDocument"];
            };
            by_cause_wh: {
                [key: string]: number;
            };
            diary: components["schemas"]["DiaryEntry"][];
            learning: components["schemas"]["LearningDocument"] | null;
        };
        CarSummary: {
            name: string;
            label: string;
            vehicle: string;
            title: string;
            trips: number;
            in_diary: number;
            left_out: {
                [key: string]: string;
            };
            has_token: boolean;
        };
        CarsResponse: {
            cars: components["schemas"]["CarSummary"][] | null;
        };
        ChargingDocument: {
            p_arrive: number;
            p_reserve: number;
            soc_arrival: number;
            soc_interval: number[];
            driving_s: number;
            charging_s: number;
            duration_s: number;
            energy_wh: number;
            label: string;
            stops: components["schemas"]["ChargingStop"][];
            energy_interval_wh: number[];
            by_cause_wh: {
                [key: string]: number;
            };
            battery_loss_wh: number;
            course: components["schemas"]["CourseDocument"];
            line: components["schemas"]["LineDocument"];
        };
        ChargingStop: {
            station: components["schemas"]["Station"];
            position_m: number;
            soc_arrival: number;
            soc_leave: number;
            soc_interval: [
                number,
                number
            ];
            energy_wh: number;
            charging_s: number;
            overhead_s: number;
            arrives_after_s: number;
            p_reach: number;
            preheat: boolean;
            if_full: components["schemas"]["NextStation"] | null;
        };
        ColumnChoice: {
            column: string;
            unit?: string | null;
        };
        CourseDocument: {
            position_m: number[];
            time_s: number[];
            displayed_soc: number[];
            low: number[];
            high: number[];
        };
        DescribedVehicle: {
            title: string;
            test_mass_kg: number;
            usable_energy_wh: number;
            anchor: string;
            wltp_kwh_per_100km: number;
            wltp_low_kwh_per_100km: number;
            wltp_high_kwh_per_100km: number;
        };
        DiaryEntry: {
            trip_id: string;
            started_at: string;
            trips_learned: number;
            distance_m: number;
            duration_s: number;
            ambient_temperature_degc: number | null;
            energy_wh: number;
            forecast_wh: number;
            low_wh: number;
            high_wh: number;
            book_forecast_wh: number;
            book_low_wh: number;
            book_high_wh: number;
            by_cause_wh: {
                [key: string]: number;
            };
            on_the_way: components["schemas"]["MadeForecast"][];
        };
        DifferenceDocument: {
            energy_wh: number;
            interval_wh: [
                number,
                number
            ];
            duration_s: number;
            soc_arrival: number;
            p_less: number;
            by_cause_wh: {
                [key: string]: number;
            };
        };
        DifferenceRequest: {
            one: components["schemas"]["ForecastRequest"];
            other: components["schemas"]["ForecastRequest"];
        };
        DistanceNeed: {
            target_soc: number;
            departs_at: string | null;
            soc: number | null;
            charge_wh: number | null;
            wall_wh: number | null;
            charging_s: number | null;
            preheat: components["schemas"]["PreheatDocument"] | null;
            distance_m: number;
            kind: string;
            energy_wh: number;
            energy_quantile_wh: number;
            quantile: number;
            half_wh: [
                number,
                number
            ];
            interval_wh: [
                number,
                number
            ];
            soc_needed: number;
            reserve: number;
            duration_s: number;
            flags: components["schemas"]["FlagDocument"][];
            car: string;
            doubt: components["schemas"]["Doubt"];
            message: string;
        };
        Doubt: {
            car: number;
            road: number;
            weather: number;
            day: number;
            narrows: string | null;
            narrower: number;
        };
        Elevation: {
            position_m: number[];
            elevation_m: number[];
        };
        EmptyAt: {
            early: number | null;
            expected: number | null;
            late: number | null;
        };
        ExampleResponse: {
            trip: string;
            title: string;
            vehicle: string;
            note: string;
            duration_s: number;
            distance_m: number;
            ambient_temperature_degc: number | null;
            observed_energy_wh: number;
            request: components["schemas"]["ForecastRequest"];
            observed: {
                [key: string]: (number | null)[];
            };
        };
        ExampleSummary: {
            trip: string;
            title: string;
            vehicle: string;
            note: string;
            duration_s: number;
            distance_m: number;
            ambient_temperature_degc: number | null;
            observed_energy_wh: number;
        };
        ExamplesResponse: {
            examples: components["schemas"]["ExampleSummary"][];
        };
        FieldDocument: {
            ours: string;
            units: string[];
        };
        FileDocument: {
            name: string;
            kind: number | null;
            /** @enum {string} */
            state: "read" | "in part" | "left out" | "ignored";
            rows: number;
            rows_used: number;
            logs: number;
            faults: components["schemas"]["ProblemFault"][];
        };
        FindingsDocument: {
            what: string;
            count: number;
            places: number;
            example: string;
            /** @enum {string} */
            consequence: "trimmed" | "split" | "set aside" | "noted";
        };
        FittedModel: {
            vehicle: string;
            vehicle_title: string;
            trips: number;
        } & {
            [key: string]: unknown;
        };
        FlagDocument: {
            code: string;
            subject: string;
            value: number | string | null;
            unit: string;
            message: string;
        };
        ForecastRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            trip?: string;
            samples?: {
                time_s: number[];
                speed_m_s: number[];
                elevation_m?: (number | null)[];
                grade?: (number | null)[];
                speed_limit_m_s?: (number | null)[];
                ambient_temperature_degc?: (number | null)[];
                cabin_temperature_degc?: (number | null)[];
                cabin_setpoint_degc?: (number | null)[];
                battery_temperature_degc?: (number | null)[];
                voltage_v?: (number | null)[];
                current_a?: (number | null)[];
                bms_soc?: (number | null)[];
                displayed_soc?: (number | null)[];
                motor_torque_nm?: (number | null)[];
                heating_power_w?: (number | null)[];
                requested_heating_power_w?: (number | null)[];
                aircon_power_w?: (number | null)[];
                climate_power_w?: (number | null)[];
            } | null;
            links?: components["schemas"]["Link"][] | null;
            elevation?: components["schemas"]["Elevation"] | null;
            reserve?: number | null;
            probability?: number | null;
        };
        ForecastResponse: {
            trip: string;
            given: string;
            energy_wh: number;
            quantiles_wh: {
                [key: string]: number;
            };
            soc_arrival: number;
            soc_quantiles: {
                [key: string]: number;
            };
            empty_at_m: components["schemas"]["EmptyAt"];
            missing_wh: components["schemas"]["Missing"];
            wh_per_display: number;
            p_arrive_by_soc: {
                [key: string]: number;
            };
            climb: components["schemas"]["UnknownClimbDocument"] | null;
            leave_with: components["schemas"]["LeaveWith"] | null;
            series: components["schemas"]["Series"];
            by_cause_wh: {
                [key: string]: number;
            };
            battery_loss_wh: number;
            measured_until_s: number;
            flags: components["schemas"]["FlagDocument"][];
        };
        Forgotten: {
            forgotten: string;
        };
        HealthResponse: {
            status: string;
            workers: number;
        };
        HourNeed: {
            vehicle_id: string;
            car_model: string;
            departs_at: string;
            arrives_at: string;
            trips: number;
            distance_m: number;
            energy_wh: number | null;
            energy_quantile_wh: number | null;
            soc_needed: number | null;
            soc: number | null;
            charge_wh: number | null;
            assumed: string | null;
            reasons: string | null;
        };
        JourneyAdviceRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            departs_at?: string | null;
            stops: (string | components["schemas"]["PlaceRequest"])[];
            reserve?: number | null;
            alternatives?: number;
            round_trip?: boolean;
            answers?: boolean;
            charge?: boolean;
            stop_overhead_s?: number;
            preheat_battery?: boolean;
            chance?: number;
        };
        JourneyDifferenceRequest: {
            one: components["schemas"]["PlanRequest"];
            other: components["schemas"]["PlanRequest"];
            road?: number;
        };
        KindChanges: {
            changes?: {
                [key: string]: components["schemas"]["ColumnChoice"] | null;
            };
            current_positive?: ("discharge" | "charge") | null;
        };
        KindDocument: {
            number: number;
            files: number;
            columns: string[];
            mapping: components["schemas"]["MappedColumnDocument"][];
            shipped: string | null;
            unused: string[];
            /** @enum {string} */
            current_positive: "discharge" | "charge";
            assumed: {
                [key: string]: number;
            };
        };
        KindRange: {
            range_m: number;
            half_m: [
                number,
                number
            ];
            interval_m: [
                number,
                number
            ];
            kind: string;
        };
        LearnedParameter: {
            change: number;
            sd: number;
            /** @enum {string} */
            unit: "1" | "kW";
            seen_degc: [
                number,
                number
            ] | null;
        };
        LearningDocument: {
            /** @enum {string} */
            state: "running" | "done" | "failed";
            done: number;
            total: number | null;
            added: number | null;
            known: number | null;
            entries: number | null;
            left_out: string[];
            flat: number | null;
            faults: components["schemas"]["ProblemFault"][];
        };
        LeaveWith: {
            soc_needed: number;
            reserve: number;
            probability: number;
            message: string;
        };
        LineDocument: {
            latitude_deg: number[];
            longitude_deg: number[];
            position_m: number[];
        };
        Link: {
            length_m: number;
            speed_m_s?: number | null;
            travel_time_s?: number | null;
            stop_s?: number | null;
            moving_speed_m_s?: number | null;
            speed_limit_m_s?: number | null;
            grade?: number | null;
            start_elevation_m?: number | null;
            end_elevation_m?: number | null;
        };
        LiveCarSummary: {
            car: string;
            seconds_since_message: number | null;
            on_trip: boolean;
        };
        LiveCarsResponse: {
            cars: components["schemas"]["LiveCarSummary"][];
        };
        LiveForecastDocument: {
            energy_wh: number;
            quantiles_wh: {
                [key: string]: number;
            };
            soc_arrival: number;
            soc_quantiles: {
                [key: string]: number;
            };
            reserve: number;
            p_arrive: number;
            p_arrive_at_all: number;
            measured_until_s: number;
            distance_m: number;
            flags: components["schemas"]["FlagDocument"][];
        };
        LiveMessages: {
            new: number;
            doubled: number;
            late: number;
        };
        LivePlanRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            trip?: string;
            samples?: {
                time_s: number[];
                speed_m_s: number[];
                elevation_m?: (number | null)[];
                grade?: (number | null)[];
                speed_limit_m_s?: (number | null)[];
                ambient_temperature_degc?: (number | null)[];
                cabin_temperature_degc?: (number | null)[];
                cabin_setpoint_degc?: (number | null)[];
                battery_temperature_degc?: (number | null)[];
                voltage_v?: (number | null)[];
                current_a?: (number | null)[];
                bms_soc?: (number | null)[];
                displayed_soc?: (number | null)[];
                motor_torque_nm?: (number | null)[];
                heating_power_w?: (number | null)[];
                requested_heating_power_w?: (number | null)[];
                aircon_power_w?: (number | null)[];
                climate_power_w?: (number | null)[];
            } | null;
            links?: components["schemas"]["Link"][] | null;
            elevation?: components["schemas"]["Elevation"] | null;
            reserve?: number | null;
            probability?: number | null;
            departs_at?: string | null;
        };
        LiveResponse: {
            car: string;
            seconds_since_message: number | null;
            messages: components["schemas"]["LiveMessages"];
            held: number;
            soc: number | null;
            soc_source: ("soc" | "bms_soc") | null;
            ambient_temperature_degc: number | null;
            trip: components["schemas"]["LiveTripDocument"] | null;
            plan: ("given" | "usual") | null;
            usual_trip: string | null;
            forecast: components["schemas"]["LiveForecastDocument"] | null;
            flags: components["schemas"]["FlagDocument"][];
            message: components["schemas"]["Message"] | null;
            faults: components["schemas"]["ProblemFault"][];
        };
        LiveTripDocument: {
            departs_at: string;
            duration_s: number;
            distance_m: number;
            samples: number;
        };
        LogsPreview: {
            logs: number;
            drives: number;
            distance_m: number;
            duration_s: number;
            energy_wh: number;
            from_date: string | null;
            to_date: string | null;
            ambient_degc: [
                number,
                number
            ] | null;
            lost_distance_m: number;
            lost_duration_s: number;
            findings: components["schemas"]["FindingsDocument"][];
        };
        LogsRequest: {
            kinds?: {
                [key: string]: components["schemas"]["KindChanges"];
            };
            ignored?: string[];
        };
        LogsResponse: {
            fields: components["schemas"]["FieldDocument"][];
            kinds: components["schemas"]["KindDocument"][];
            files: components["schemas"]["FileDocument"][];
            report: components["schemas"]["AlikeDocument"][];
            preview: components["schemas"]["LogsPreview"] | null;
            faults: components["schemas"]["ProblemFault"][];
        };
        MadeForecast: {
            at_s: number;
            distance_m: number;
            energy_wh: number;
            low_wh: number;
            high_wh: number;
        };
        MapResponse: {
            roads: boolean;
            places: boolean;
            weather: boolean;
            tiles: boolean;
            stations: number;
            bounds_deg: number[] | null;
            covers: string;
            terrain: components["schemas"]["TerrainDocument"];
            attribution: string;
        };
        MappedColumnDocument: {
            ours: string;
            column: string;
            unit: string;
            why: string;
        };
        Message: {
            time_s: number;
            /** @enum {string} */
            verdict: "arrives" | "open" | "does_not_arrive";
            soc_arrival: number;
            p_arrive: number;
            speed_m_s: number | null;
            p_at_speed: number | null;
        };
        Missing: {
            least: number;
            expected: number;
            most: number;
        };
        ModelSummary: {
            name: string;
            model: components["schemas"]["FittedModel"];
            contract: {
                [key: string]: unknown;
            };
            provenance: {
                [key: string]: unknown;
            };
            evaluation: {
                [key: string]: unknown;
            };
        };
        ModelsResponse: {
            models: components["schemas"]["ModelSummary"][];
        };
        NeedAnswer: components["schemas"]["DistanceNeed"] | components["schemas"]["NeedResponse"];
        NeedResponse: {
            target_soc: number;
            departs_at: string | null;
            soc: number | null;
            charge_wh: number | null;
            wall_wh: number | null;
            charging_s: number | null;
            preheat: components["schemas"]["PreheatDocument"] | null;
            car: string;
            /** @enum {string} */
            plan: "given" | "usual";
            usual_trip: string | null;
            probability: number;
            reserve: number;
            expected_wh: number;
            energy_quantile_wh: number;
            soc_needed: number;
            message: string;
            wh_per_display: number;
            flags: components["schemas"]["FlagDocument"][];
        };
        NewCarRequest: {
            name: string;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
        };
        NextStation: {
            station: components["schemas"]["Station"];
            soc_arrival: number;
            p_reach: number;
            more_s: number;
        };
        NightRequest: {
            model?: string | null;
            trips: components["schemas"]["PlannedTripRequest"][];
            quantile?: number;
            reserve?: number | null;
            plug_w?: number;
            begins_at?: string | null;
        };
        NightResponse: {
            needs: components["schemas"]["HourNeed"][];
            emhass: {
                [key: string]: unknown;
            };
            evcc: string[];
        };
        PlaceDocument: {
            name: string;
            kind: string;
            context: string;
            also_called: string;
            latitude_deg: number;
            longitude_deg: number;
        };
        PlaceRequest: {
            latitude_deg: number;
            longitude_deg: number;
            name?: string;
        };
        PlacesResponse: {
            places: components["schemas"]["PlaceDocument"][];
            attribution: string;
        };
        PlanRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            departs_at?: string | null;
            stops: (string | components["schemas"]["PlaceRequest"])[];
            reserve?: number | null;
            alternatives?: number;
            round_trip?: boolean;
            answers?: boolean;
            charge?: boolean;
            stop_overhead_s?: number;
            preheat_battery?: boolean;
        };
        PlanResponse: {
            stops: components["schemas"]["PlaceDocument"][];
            reserve: number;
            verdict: components["schemas"]["VerdictDocument"];
            arrives: boolean;
            p_arrive: number;
            soc_needed: number;
            leave: string;
            costs_wh: {
                [key: string]: number;
            };
            needs_motorway_speed: boolean;
            motorway_speed_m_s: number | null;
            motorway_duration_s: number | null;
            charging: components["schemas"]["ChargingDocument"] | null;
            charging_alternatives: components["schemas"]["ChargingDocument"][];
            roads: components["schemas"]["RoadDocument"][];
            flags: components["schemas"]["FlagDocument"][];
            attribution: string;
        };
        PlannedTripRequest: {
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            vehicle_id: string;
            trip?: string;
            /** Format: date-time */
            departs_at: string;
            distance_km?: number | null;
            /** @enum {string} */
            kind?: "city" | "country" | "motorway" | "mixed";
            links?: components["schemas"]["Link"][] | null;
            vehicle?: string | null;
            driver?: string | null;
        };
        PolygonDocument: {
            /** @constant */
            type: "Polygon";
            coordinates: number[][][];
        };
        PreheatDocument: {
            starts_at: string | null;
            before_s: number;
            cabin_degc: number | null;
            cabin_before_s: number;
            battery_degc: number | null;
            battery_before_s: number;
            wall_wh: number;
            saved_wh: number;
        };
        ProblemDocument: {
            /** @enum {string} */
            type: "/problems/not-json" | "/problems/bad-request" | "/problems/host-not-served" | "/problems/token-needed" | "/problems/foreign-site" | "/problems/not-found" | "/problems/no-such-car" | "/problems/no-plan" | "/problems/method-not-allowed" | "/problems/name-taken" | "/problems/body-late" | "/problems/too-large" | "/problems/media-type" | "/problems/invalid-input" | "/problems/key-used" | "/problems/head-too-large" | "/problems/too-many-requests" | "/problems/internal" | "/problems/no-map" | "/problems/no-live" | "/problems/remote" | "/problems/busy" | "/problems/timeout";
            title: string;
            status: number;
            detail?: string | null;
            instance?: string | null;
            faults?: components["schemas"]["ProblemFault"][] | null;
            more_faults?: number | null;
            trip?: string | null;
        };
        ProblemFault: {
            what: string;
            where: string;
            pointer?: string | null;
            got?: string | null;
            allowed?: string | null;
            fix?: string | null;
        };
        RangeResponse: {
            range_m: number;
            half_m: [
                number,
                number
            ];
            interval_m: [
                number,
                number
            ];
            soc: number;
            reserve: number;
            by_kind: components["schemas"]["KindRange"][];
            flags: components["schemas"]["FlagDocument"][];
            doubt: components["schemas"]["Doubt"];
        };
        ReachRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            departs_at?: string | null;
            start: string | components["schemas"]["PlaceRequest"];
            reserve?: number | null;
        };
        ReachResponse: {
            start: components["schemas"]["PlaceDocument"];
            areas: components["schemas"]["AreaDocument"][];
            map_ends: boolean;
            flags: components["schemas"]["FlagDocument"][];
            attribution: string;
        };
        RoadDocument: {
            labels: string[];
            distance_m: number;
            duration_s: number;
            line: components["schemas"]["LineDocument"];
            links: components["schemas"]["RoadLinks"];
            stops: components["schemas"]["StopDocument"][];
            samples: {
                [key: string]: (number | null)[];
            };
            forecast: components["schemas"]["ForecastResponse"];
        };
        RoadLinks: {
            length_m: number[];
            travel_time_s: number[];
            road_class: string[];
        };
        RouteResponse: {
            samples: {
                [key: string]: (number | null)[];
            };
            links: components["schemas"]["Link"][] | null;
            elevation: components["schemas"]["Elevation"] | null;
            duration_s: number;
            distance_m: number;
            notes: components["schemas"]["FlagDocument"][];
        };
        ScoreDocument: {
            trips: number;
            error: number | null;
            weighted_error: number | null;
            bias: number | null;
            coverage: number | null;
            width: number | null;
            inside: number;
            needed_width: number | null;
        };
        SeasonDocument: {
            trips: number;
            distance_m: number;
            energy_wh: number;
            error: number | null;
            coverage: number | null;
        };
        Series: {
            time_s: number[];
            distance_m: number[];
            energy_wh: number[];
            energy_low_wh: number[];
            energy_high_wh: number[];
            displayed_soc: number[];
            displayed_soc_low: number[];
            displayed_soc_high: number[];
        };
        SpeedCapDocument: {
            speed_m_s: number;
            longer_s: number;
            saved_wh: number;
            charging_w: number;
        };
        Station: {
            latitude_deg: number;
            longitude_deg: number;
            name: string;
            power_w: number;
            direct_current: boolean;
            power_known: boolean;
            plugs: string[];
        };
        StopDocument: {
            position_m: number;
            displayed_soc: number;
        };
        TelemetryRequest: {
            tlm: {
                [key: string]: unknown;
            } | string;
            token?: string | null;
        } & {
            [key: string]: unknown;
        };
        TelemetryResponse: {
            /** @enum {string} */
            status: "ok" | "held";
            car: string;
            /** @enum {string} */
            arrival: "new" | "doubled" | "held";
            ignored: components["schemas"]["ProblemFault"][];
        };
        TerrainDocument: {
            known: boolean;
            source: string;
        };
        TokenResponse: {
            token: string;
        };
        UnknownClimbDocument: {
            terrain: string;
            soc_per_m: number;
            changes_at_m: {
                [key: string]: number | null;
            };
        };
        UpdateRequest: {
            model?: string | null;
            vehicle?: string | null;
            vehicle_figures?: components["schemas"]["VehicleFigures"] | null;
            vehicle_id?: string | null;
            driver?: string | null;
            soc?: number | null;
            ambient_temperature_degc?: number | null;
            cabin_setpoint_degc?: number | null;
            cabin_temperature_degc?: number | null;
            battery_temperature_degc?: number | null;
            payload_mass_kg?: number | null;
            climate?: ("auto" | "off" | "heat" | "cool") | null;
            extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[] | null;
            terrain?: ("unknown" | "flat" | "hilly" | "mountains") | null;
            wind_speed_m_s?: number | null;
            wind_from_deg?: number | null;
            rain_mm_h?: number | null;
            pressure_pa?: number | null;
            tyre_pressure?: number | null;
            trip?: string;
            samples?: {
                time_s: number[];
                speed_m_s: number[];
                elevation_m?: (number | null)[];
                grade?: (number | null)[];
                speed_limit_m_s?: (number | null)[];
                ambient_temperature_degc?: (number | null)[];
                cabin_temperature_degc?: (number | null)[];
                cabin_setpoint_degc?: (number | null)[];
                battery_temperature_degc?: (number | null)[];
                voltage_v?: (number | null)[];
                current_a?: (number | null)[];
                bms_soc?: (number | null)[];
                displayed_soc?: (number | null)[];
                motor_torque_nm?: (number | null)[];
                heating_power_w?: (number | null)[];
                requested_heating_power_w?: (number | null)[];
                aircon_power_w?: (number | null)[];
                climate_power_w?: (number | null)[];
            } | null;
            links?: components["schemas"]["Link"][] | null;
            elevation?: components["schemas"]["Elevation"] | null;
            reserve?: number | null;
            probability?: number | null;
            observed: {
                time_s: number[];
                speed_m_s?: (number | null)[];
                elevation_m?: (number | null)[];
                grade?: (number | null)[];
                speed_limit_m_s?: (number | null)[];
                ambient_temperature_degc?: (number | null)[];
                cabin_temperature_degc?: (number | null)[];
                cabin_setpoint_degc?: (number | null)[];
                battery_temperature_degc?: (number | null)[];
                voltage_v?: (number | null)[];
                current_a?: (number | null)[];
                bms_soc?: (number | null)[];
                displayed_soc?: (number | null)[];
                motor_torque_nm?: (number | null)[];
                heating_power_w?: (number | null)[];
                requested_heating_power_w?: (number | null)[];
                aircon_power_w?: (number | null)[];
                climate_power_w?: (number | null)[];
            };
        };
        UploadResponse: {
            files: number;
            bytes: number;
        };
        VehicleFigures: {
            mass_kg?: number | null;
            usable_battery_kwh?: number | null;
            consumption_kwh_per_100km?: number | null;
            motor_power_kw?: number | null;
            body?: ("small" | "hatchback" | "sedan" | "estate" | "suv" | "van" | "pickup" | "quadricycle") | null;
            heat_pump?: boolean | null;
            /** @enum {string} */
            procedure?: "wltp" | "epa";
            title?: string | null;
        };
        VehicleSummary: {
            name: string;
            title: string;
            test_mass_kg: number;
            usable_energy_wh: number;
            has_climate: boolean;
            anchor: string;
            models: string[];
        };
        VehiclesResponse: {
            vehicles: components["schemas"]["VehicleSummary"][];
        };
        VerdictDocument: {
            p_arrive: number;
            p_reserve: number;
            soc_arrival: number;
            soc_interval: number[];
            driving_s: number;
            charging_s: number;
            duration_s: number;
            energy_wh: number;
            arrives: boolean;
            departs_at: string | null;
            arrives_at: string | null;
            charges: number;
            /** @enum {string} */
            advice: "go" | "stop" | "charge_before" | "slower" | "none";
        };
        ViewResponse: {
            settlements: components["schemas"]["PlaceDocument"][];
            stations: components["schemas"]["Station"][];
            attribution: string;
        };
        WholeDocument: {
            duration_s: number;
            charges: number;
            p_reserve: number;
        };
    };
    responses: never;
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type ActionDocument = components['schemas']['ActionDocument'];
export type AdviceRequest = components['schemas']['AdviceRequest'];
export type AdviceResponse = components['schemas']['AdviceResponse'];
export type AdvisedDocument = components['schemas']['AdvisedDocument'];
export type AlikeDocument = components['schemas']['AlikeDocument'];
export type AreaDocument = components['schemas']['AreaDocument'];
export type CarResponse = components['schemas']['CarResponse'];
export type CarSummary = components['schemas']['CarSummary'];
export type CarsResponse = components['schemas']['CarsResponse'];
export type ChargingDocument = components['schemas']['ChargingDocument'];
export type ChargingStop = components['schemas']['ChargingStop'];
export type ColumnChoice = components['schemas']['ColumnChoice'];
export type CourseDocument = components['schemas']['CourseDocument'];
export type DescribedVehicle = components['schemas']['DescribedVehicle'];
export type DiaryEntry = components['schemas']['DiaryEntry'];
export type DifferenceDocument = components['schemas']['DifferenceDocument'];
export type DifferenceRequest = components['schemas']['DifferenceRequest'];
export type DistanceNeed = components['schemas']['DistanceNeed'];
export type Doubt = components['schemas']['Doubt'];
export type Elevation = components['schemas']['Elevation'];
export type EmptyAt = components['schemas']['EmptyAt'];
export type ExampleResponse = components['schemas']['ExampleResponse'];
export type ExampleSummary = components['schemas']['ExampleSummary'];
export type ExamplesResponse = components['schemas']['ExamplesResponse'];
export type FieldDocument = components['schemas']['FieldDocument'];
export type FileDocument = components['schemas']['FileDocument'];
export type FindingsDocument = components['schemas']['FindingsDocument'];
export type FittedModel = components['schemas']['FittedModel'];
export type FlagDocument = components['schemas']['FlagDocument'];
export type ForecastRequest = components['schemas']['ForecastRequest'];
export type ForecastResponse = components['schemas']['ForecastResponse'];
export type Forgotten = components['schemas']['Forgotten'];
export type HealthResponse = components['schemas']['HealthResponse'];
export type HourNeed = components['schemas']['HourNeed'];
export type JourneyAdviceRequest = components['schemas']['JourneyAdviceRequest'];
export type JourneyDifferenceRequest = components['schemas']['JourneyDifferenceRequest'];
export type KindChanges = components['schemas']['KindChanges'];
export type KindDocument = components['schemas']['KindDocument'];
export type KindRange = components['schemas']['KindRange'];
export type LearnedParameter = components['schemas']['LearnedParameter'];
export type LearningDocument = components['schemas']['LearningDocument'];
export type LeaveWith = components['schemas']['LeaveWith'];
export type LineDocument = components['schemas']['LineDocument'];
export type Link = components['schemas']['Link'];
export type LiveCarSummary = components['schemas']['LiveCarSummary'];
export type LiveCarsResponse = components['schemas']['LiveCarsResponse'];
export type LiveForecastDocument = components['schemas']['LiveForecastDocument'];
export type LiveMessages = components['schemas']['LiveMessages'];
export type LivePlanRequest = components['schemas']['LivePlanRequest'];
export type LiveResponse = components['schemas']['LiveResponse'];
export type LiveTripDocument = components['schemas']['LiveTripDocument'];
export type LogsPreview = components['schemas']['LogsPreview'];
export type LogsRequest = components['schemas']['LogsRequest'];
export type LogsResponse = components['schemas']['LogsResponse'];
export type MadeForecast = components['schemas']['MadeForecast'];
export type MapResponse = components['schemas']['MapResponse'];
export type MappedColumnDocument = components['schemas']['MappedColumnDocument'];
export type Message = components['schemas']['Message'];
export type Missing = components['schemas']['Missing'];
export type ModelSummary = components['schemas']['ModelSummary'];
export type ModelsResponse = components['schemas']['ModelsResponse'];
export type NeedAnswer = components['schemas']['NeedAnswer'];
export type NeedResponse = components['schemas']['NeedResponse'];
export type NewCarRequest = components['schemas']['NewCarRequest'];
export type NextStation = components['schemas']['NextStation'];
export type NightRequest = components['schemas']['NightRequest'];
export type NightResponse = components['schemas']['NightResponse'];
export type PlaceDocument = components['schemas']['PlaceDocument'];
export type PlaceRequest = components['schemas']['PlaceRequest'];
export type PlacesResponse = components['schemas']['PlacesResponse'];
export type PlanRequest = components['schemas']['PlanRequest'];
export type PlanResponse = components['schemas']['PlanResponse'];
export type PlannedTripRequest = components['schemas']['PlannedTripRequest'];
export type PolygonDocument = components['schemas']['PolygonDocument'];
export type PreheatDocument = components['schemas']['PreheatDocument'];
export type ProblemDocument = components['schemas']['ProblemDocument'];
export type ProblemFault = components['schemas']['ProblemFault'];
export type RangeResponse = components['schemas']['RangeResponse'];
export type ReachRequest = components['schemas']['ReachRequest'];
export type ReachResponse = components['schemas']['ReachResponse'];
export type RoadDocument = components['schemas']['RoadDocument'];
export type RoadLinks = components['schemas']['RoadLinks'];
export type RouteResponse = components['schemas']['RouteResponse'];
export type ScoreDocument = components['schemas']['ScoreDocument'];
export type SeasonDocument = components['schemas']['SeasonDocument'];
export type Series = components['schemas']['Series'];
export type SpeedCapDocument = components['schemas']['SpeedCapDocument'];
export type Station = components['schemas']['Station'];
export type StopDocument = components['schemas']['StopDocument'];
export type TelemetryRequest = components['schemas']['TelemetryRequest'];
export type TelemetryResponse = components['schemas']['TelemetryResponse'];
export type TerrainDocument = components['schemas']['TerrainDocument'];
export type TokenResponse = components['schemas']['TokenResponse'];
export type UnknownClimbDocument = components['schemas']['UnknownClimbDocument'];
export type UpdateRequest = components['schemas']['UpdateRequest'];
export type UploadResponse = components['schemas']['UploadResponse'];
export type VehicleFigures = components['schemas']['VehicleFigures'];
export type VehicleSummary = components['schemas']['VehicleSummary'];
export type VehiclesResponse = components['schemas']['VehiclesResponse'];
export type VerdictDocument = components['schemas']['VerdictDocument'];
export type ViewResponse = components['schemas']['ViewResponse'];
export type WholeDocument = components['schemas']['WholeDocument'];
export type $defs = Record<string, never>;
export interface operations {
    forecast: {
        parameters: {
            query?: {
                fields?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ForecastRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ForecastResponse"];
                };
            };
        };
    };
    update: {
        parameters: {
            query?: {
                fields?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["UpdateRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ForecastResponse"];
                };
            };
        };
    };
    difference: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["DifferenceRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["DifferenceDocument"];
                };
            };
        };
    };
    advice: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["AdviceRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["AdviceResponse"];
                };
            };
        };
    };
    batch: {
        parameters: {
            query?: {
                fields?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/x-ndjson": unknown;
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/x-ndjson": string;
                };
            };
        };
    };
    route: {
        parameters: {
            query?: {
                speed_m_s?: number;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/gpx+xml": string;
                "application/xml": string;
                "text/xml": string;
                "application/vnd.google-earth.kml+xml": string;
                "text/csv": string;
                "application/octet-stream": string;
                "application/geo+json": Record<string, unknown>;
                "application/json": Record<string, unknown>;
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["RouteResponse"];
                };
            };
        };
    };
    plan: {
        parameters: {
            query?: {
                fields?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["PlanRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PlanResponse"];
                };
            };
        };
    };
    journey_difference: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["JourneyDifferenceRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["DifferenceDocument"];
                };
            };
        };
    };
    journey_advice: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["JourneyAdviceRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["AdviceResponse"];
                };
            };
        };
    };
    reach: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ReachRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ReachResponse"];
                };
            };
        };
    };
    get_need: {
        parameters: {
            query?: {
                soc?: number;
                ambient_temperature_degc?: number;
                cabin_setpoint_degc?: number;
                cabin_temperature_degc?: number;
                battery_temperature_degc?: number;
                payload_mass_kg?: number;
                departs_at?: string;
                climate?: "auto" | "off" | "heat" | "cool";
                extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[];
                terrain?: "unknown" | "flat" | "hilly" | "mountains";
                wind_speed_m_s?: number;
                wind_from_deg?: number;
                rain_mm_h?: number;
                pressure_pa?: number;
                tyre_pressure?: number;
                kind?: "city" | "country" | "motorway" | "mixed";
                model?: string;
                vehicle?: string;
                car?: string;
                vehicle_figures?: string;
                reserve?: number;
                distance_km?: number;
                trip?: string;
                quantile?: number;
                trips?: number;
                probability?: number;
                plug_w?: number;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["NeedAnswer"];
                };
            };
        };
    };
    get_range: {
        parameters: {
            query?: {
                soc?: number;
                ambient_temperature_degc?: number;
                cabin_setpoint_degc?: number;
                cabin_temperature_degc?: number;
                battery_temperature_degc?: number;
                payload_mass_kg?: number;
                departs_at?: string;
                climate?: "auto" | "off" | "heat" | "cool";
                extras?: ("winter_tyres" | "roof_box" | "trailer" | "headlights" | "heated_seats")[];
                terrain?: "unknown" | "flat" | "hilly" | "mountains";
                wind_speed_m_s?: number;
                wind_from_deg?: number;
                rain_mm_h?: number;
                pressure_pa?: number;
                tyre_pressure?: number;
                kind?: "city" | "country" | "motorway" | "mixed";
                model?: string;
                vehicle?: string;
                car?: string;
                vehicle_figures?: string;
                reserve?: number;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["RangeResponse"];
                };
            };
        };
    };
    get_places: {
        parameters: {
            query: {
                q: string;
                limit?: number;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PlacesResponse"];
                };
            };
        };
    };
    get_map: {
        parameters: {
            query?: never;
            header?: {
                "If-None-Match"?: string;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapResponse"];
                };
            };
        };
    };
    get_view: {
        parameters: {
            query: {
                south: number;
                west: number;
                north: number;
                east: number;
                limit?: number;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ViewResponse"];
                };
            };
        };
    };
    get_tile: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                zoom: number;
                column: number;
                row: number;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/vnd.mapbox-vector-tile": string;
                };
            };
        };
    };
    get_models: {
        parameters: {
            query?: never;
            header?: {
                "If-None-Match"?: string;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ModelsResponse"];
                };
            };
        };
    };
    get_vehicles: {
        parameters: {
            query?: {
                search?: string;
            };
            header?: {
                "If-None-Match"?: string;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["VehiclesResponse"];
                };
            };
        };
    };
    describe: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["VehicleFigures"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["DescribedVehicle"];
                };
            };
        };
    };
    get_examples: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ExamplesResponse"];
                };
            };
        };
    };
    get_example: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                trip: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ExampleResponse"];
                };
            };
        };
    };
    healthz: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["HealthResponse"];
                };
            };
        };
    };
    readyz: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["HealthResponse"];
                };
            };
        };
    };
    get_metrics: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "text/plain": string;
                };
            };
        };
    };
    fleet_needs: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["NightRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["NightResponse"];
                };
            };
        };
    };
    get_fleet_report: {
        parameters: {
            query?: {
                model?: string;
            };
            header?: {
                "If-None-Match"?: string;
            };
            path: {
                file: "report.html" | "report.json" | "changes.csv" | "vehicles.csv" | "drivers.csv" | "needs.csv" | "routes.csv" | "emhass.json" | "evcc.txt";
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    ETag?: string;
                    [name: string]: unknown;
                };
                content: {
                    "text/html": string;
                    "application/json": unknown;
                    "text/csv": string;
                    "text/plain": string;
                };
            };
        };
    };
    telemetry: {
        parameters: {
            query?: {
                token?: string;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["TelemetryRequest"];
                "application/x-www-form-urlencoded": components["schemas"]["TelemetryRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["TelemetryResponse"];
                };
            };
        };
    };
    list_live: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["LiveCarsResponse"];
                };
            };
        };
    };
    get_live: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["LiveResponse"];
                };
            };
        };
    };
    put_plan: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["LivePlanRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["LiveResponse"];
                };
            };
        };
    };
    get_events: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "text/event-stream": string;
                };
            };
        };
    };
    list_cars: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CarsResponse"];
                };
            };
        };
    };
    new_car: {
        parameters: {
            query?: never;
            header?: {
                "Idempotency-Key"?: string;
            };
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["NewCarRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CarResponse"];
                };
            };
        };
    };
    get_car: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CarResponse"];
                };
            };
        };
    };
    forget_car: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Forgotten"];
                };
            };
        };
    };
    new_token: {
        parameters: {
            query?: never;
            header?: {
                "Idempotency-Key"?: string;
            };
            path: {
                car: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["TokenResponse"];
                };
            };
        };
    };
    put_file: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
                upload: string;
                file: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/octet-stream": string;
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["UploadResponse"];
                };
            };
        };
    };
    read_logs: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                car: string;
                upload: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["LogsRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["LogsResponse"];
                };
            };
        };
    };
    learn: {
        parameters: {
            query?: never;
            header?: {
                "Idempotency-Key"?: string;
            };
            path: {
                car: string;
                upload: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["LogsRequest"];
            };
        };
        responses: {
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CarResponse"];
                };
            };
        };
    };
}
